#include "frontend/geometry/rolling_shutter.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tutti {
namespace {

constexpr internal::GaussNewtonLimits kShutterLimits{10, 1e-7, 1e-5, 0};
constexpr int kDepthRounds = 2;             // of looking up where a pixel was when depth was taken
constexpr double kDepthTimeSigma = 0.0025;  // of the time when a depth image was taken [s]

}  // namespace

double RollingShutter::InverseDepth(const DepthImage& depth, const Eigen::Vector3d& ray, double first_m,
                                    const Pose& T_taken_row, int rounds) const {
  const Pose T_row_taken = T_taken_row.Inverse();
  double z = first_m, sign = 1;
  for (int round = 0; round < rounds; ++round) {
    const Eigen::Vector3d then = T_taken_row * (ray * z);
    if (!(then.z() > kMinDepth)) return 0;
    const Eigen::Vector2d pixel = camera_.Project(then);
    if (!(pixel.x() > 0 && pixel.y() > 0 && pixel.x() < camera_.width && pixel.y() < camera_.height))
      return 0;
    const double inverse = double(
        depth.InverseAt(static_cast<int>(std::lround(pixel.x())), static_cast<int>(std::lround(pixel.y()))));
    if (inverse == 0) return 0;
    sign = inverse < 0 ? -1 : 1;
    z = (T_row_taken * (camera_.Unproject(pixel) / std::abs(inverse))).z();
    if (!(z > kMinDepth)) return 0;
  }
  return sign / z;
}

// Depths of features and of the grid, each when its row is read. A time that is not quite right makes depth
// on slanted surfaces less sure.
void RollingShutter::TakeDepth(const FrameFeatures& seen, const Vector6d& motion, double first_m,
                               FrameFeatures* out) const {
  const DepthImage& depth = *seen.depth_image;
  // Rows of depth follow each other as those of colour do, and a pixel moves by few rows.
  const Pose T_taken_row = ExpSE3(motion * depth.later_s),
             T_late_row = ExpSE3(motion * (depth.later_s + kDepthTimeSigma));
  for (std::size_t f = 0; f < seen.size(); ++f) {
    const Eigen::Vector2d pixel(seen.keypoints[f].pt.x, seen.keypoints[f].pt.y);
    const double first = seen.inverse_depth[f] > 0 ? 1 / double(seen.inverse_depth[f]) : first_m;
    const Eigen::Vector3d ray = camera_.Unproject(pixel);
    const double inverse = std::max(0.0, InverseDepth(depth, ray, first, T_taken_row, kDepthRounds));
    out->inverse_depth[f] = static_cast<float>(inverse);
    const double other = inverse > 0 ? InverseDepth(depth, ray, 1 / inverse, T_late_row, 1) : 0;
    out->inverse_depth_sigma[f] =
        inverse > 0 ? static_cast<float>(std::hypot(depth.inverse_sigma, other > 0 ? other - inverse : 0.0))
                    : 0.0F;
  }
  if (!seen.depth_grid) return;
  auto grid = std::make_shared<DepthGrid>(*seen.depth_grid);
  auto element = grid->inverse_depth.begin();
  for (int r = 0; r < grid->Rows(); ++r) {
    for (int c = 0; c < grid->columns; ++c) {
      float& inverse = *element++;
      const double first = inverse != 0 ? 1 / std::abs(double(inverse)) : first_m;
      inverse = static_cast<float>(
          InverseDepth(depth, camera_.Unproject(grid->PixelOf(r, c)), first, T_taken_row, 1));
    }
  }
  out->depth_grid = std::move(grid);
}

std::shared_ptr<const FrameFeatures> RollingShutter::Straighten(const FrameFeatures& seen,
                                                                const Vector6d& motion, double depth) const {
  auto out = std::make_shared<FrameFeatures>(seen);
  out->rolled.assign(seen.size(), cv::Point2f());
  if (seen.depth_image) TakeDepth(seen, motion, depth, out.get());
  out->depth_image.reset();
  for (std::size_t f = 0; f < seen.size(); ++f) {
    cv::KeyPoint& k = out->keypoints[f];
    const float inverse = out->inverse_depth[f];
    const Eigen::Vector3d ray = camera_.Unproject({k.pt.x, k.pt.y});
    const Pose T_middle_row = ExpSE3(motion * -TimeOf(k.pt.y));
    const Eigen::Vector3d p = T_middle_row * (ray * (inverse > 0 ? 1.0 / double(inverse) : depth));
    if (!(p.z() > kMinDepth)) continue;
    const Eigen::Vector2d pixel = camera_.Project(p);
    const cv::Point2f moved(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    out->rolled[f] = moved - k.pt;
    k.pt = moved;
    if (inverse > 0) out->inverse_depth[f] = static_cast<float>(1.0 / p.z());
  }
  out->BuildGrid(camera_.width, camera_.height);
  return out;
}

int RollingShutter::Refine(const std::vector<PointObservation>& observations, const MotionPrior& prior,
                           Pose* T_camera_world, Vector6d* motion, std::vector<char>* inlier) const {
  using Matrix3x12 = Eigen::Matrix<double, 3, 12>;
  *motion = prior.motion;
  const auto residual = [&](const PointObservation& o, Eigen::Vector3d* r, Matrix3x12* j) {
    const Pose then = ExpSE3(*motion * TimeOf(o.pixel.y())) * *T_camera_world;
    if (j == nullptr) return ReprojectionResidual(camera_, then, o, r, nullptr);
    Eigen::Matrix<double, 3, 6> by_pose;
    if (!ReprojectionResidual(camera_, then, o, r, &by_pose)) return false;
    *j << by_pose,
        by_pose * TimeOf(o.pixel.y());  // rows are near in time: their poses move as the middle one's
    return true;
  };
  const auto add_prior = [&](internal::NormalEquations<12>* equations) {
    prior.Add(*T_camera_world, *motion, equations);
  };
  const auto move = [&](const Eigen::Matrix<double, 12, 1>& step) {
    *T_camera_world = Pose(ExpSO3(step.segment<3>(3)), step.head<3>()) * *T_camera_world;
    *motion += step.tail<6>();
    return true;
  };
  const int inliers = RefineOnInliers<12>(observations, kShutterLimits, 6, residual, add_prior, move, inlier);
  if (T_camera_world->IsFinite() && motion->allFinite()) return inliers;
  inlier->assign(observations.size(), 0);
  return 0;
}

}  // namespace tutti
