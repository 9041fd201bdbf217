#include "data/synthetic/given_path.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "tutti/core/error.h"

namespace tutti::synthetic {
namespace {

MountedCamera Mounted(const std::array<double, 4>& intrinsics, const DistortionCoefficients& lens,
                      const std::array<double, 12>& rows) {
  MountedCamera mounted;
  PinholeCamera& c = mounted.camera;
  c.width = 752, c.height = 480;
  c.fx = intrinsics[0], c.fy = intrinsics[1], c.cx = intrinsics[2], c.cy = intrinsics[3];
  c.distortion = Distortion::kRadTan;
  c.coefficients = lens;
  Eigen::Matrix<double, 3, 4> matrix;
  for (int i = 0; i < 12; ++i) matrix(i / 4, i % 4) = rows[static_cast<std::size_t>(i)];
  mounted.T_body_camera = Pose::FromMatrix(matrix);
  return mounted;
}

}  // namespace

std::vector<MountedCamera> EurocCameras() {
  return {
      Mounted({458.654, 457.296, 367.215, 248.375}, {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0},
              {0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975, 0.999557249008,
               0.0149672133247, 0.025715529948, -0.064676986768, -0.0257744366974, 0.00375618835797,
               0.999660727178, 0.00981073058949}),
      Mounted({457.587, 456.134, 379.999, 255.238},
              {-0.28368365, 0.07451284, -0.00010473, -3.55590700e-05, 0},
              {0.0125552670891, -0.999755099723, 0.0182237714554, -0.0198435579556, 0.999598781151,
               0.0130119051815, 0.0251588363115, 0.0453689425024, -0.0253898008918, 0.0179005838253,
               0.999517347078, 0.00786212447038})};
}

std::vector<double> FrameStamps(const Trajectory& poses, double rate_hz) {
  std::vector<double> stamps;
  const double first = poses.front().stamp_s, length = poses.back().stamp_s - first;
  if (rate_hz > 0) {
    for (std::size_t i = 0; static_cast<double>(i) <= length * rate_hz; ++i)
      stamps.push_back(first + static_cast<double>(i) / rate_hz);
    return stamps;
  }
  if (static_cast<double>(poses.size() - 1) > 60 * length)
    throw InputError("the path has more than 60 poses a second; say how many frames to render (--rate 20)");
  for (const StampedPose& p : poses) stamps.push_back(p.stamp_s);
  return stamps;
}

Lens::Lens(const PinholeCamera& camera, int supersample)
    : camera_(camera), plain_(camera), supersample_(supersample) {
  if (camera.distortion == Distortion::kNone) return;
  Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);  // of the rays along the border
  const auto see = [&](double u, double v) {
    const Eigen::Vector2d ray = camera.Unproject({u, v}).head<2>();
    low = low.cwiseMin(ray), high = high.cwiseMax(ray);
  };
  const double right = camera.width, bottom = camera.height;
  for (double u = -1; u <= right; u += 1) see(u, -1), see(u, bottom);
  for (double v = -1; v <= bottom; v += 1) see(-1, v), see(right, v);
  plain_ = PinholeCamera();
  plain_.fx = camera.fx * supersample, plain_.fy = camera.fy * supersample;
  plain_.cx = 2 - low.x() * plain_.fx, plain_.cy = 2 - low.y() * plain_.fy;
  plain_.width = static_cast<int>(std::ceil(plain_.cx + high.x() * plain_.fx)) + 3;
  plain_.height = static_cast<int>(std::ceil(plain_.cy + high.y() * plain_.fy)) + 3;
  const auto map = [&](int s, cv::Mat& to) {
    to.create(camera.height * s, camera.width * s, CV_32FC2);
    for (int y = 0; y < to.rows; ++y) {
      for (int x = 0; x < to.cols; ++x) {
        const Eigen::Vector3d ray = camera.Unproject({(x + 0.5) / s - 0.5, (y + 0.5) / s - 0.5});
        const Eigen::Vector2d at = plain_.Project(ray);
        to.at<cv::Vec2f>(y, x) = cv::Vec2f(static_cast<float>(at.x()), static_cast<float>(at.y()));
      }
    }
  };
  map(supersample, samples_);
  map(1, centres_);
}

Rendering Lens::See(const std::vector<Face>& faces, const std::vector<Texture>& textures,
                    const Pose& T_world_camera, const Light& light) const {
  if (samples_.empty()) return Render(faces, textures, camera_, T_world_camera, light, supersample_);
  const Rendering plain = Render(faces, textures, plain_, T_world_camera, light, 1);
  Rendering bent;
  cv::Mat samples;
  cv::remap(plain.image, samples, samples_, cv::noArray(), cv::INTER_LINEAR);
  cv::resize(samples, bent.image, cv::Size(camera_.width, camera_.height), 0, 0, cv::INTER_AREA);
  cv::remap(plain.depth_m, bent.depth_m, centres_, cv::noArray(), cv::INTER_NEAREST);
  return bent;
}

}  // namespace tutti::synthetic
