#include "frontend/features/rectifier.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include "tutti/core/error.h"

namespace tutti {
namespace {

// Part of the plane z = 1 that is seen.
struct View {
  double left, right, top, bottom;
};

// Wider views than 60 deg to a side waste most pixels of a pinhole image on its border.
constexpr double kWidest = 1.7320508075688772;

// The largest axis-parallel rectangle that the border of the image encloses, seen in axes turned by R.
View InnerView(const PinholeCamera& camera, const Eigen::Matrix3d& R_rectified_camera) {
  View view{-kWidest, kWidest, -kWidest, kWidest};
  const auto ray = [&](double u, double v) {
    const Eigen::Vector3d r = R_rectified_camera * camera.Unproject({u, v});
    return Eigen::Vector2d(r.head<2>() / std::max(r.z(), 1e-6));
  };
  constexpr int kSteps = 64;
  for (int i = 0; i <= kSteps; ++i) {
    const double u = (camera.width - 1.0) * i / kSteps, v = (camera.height - 1.0) * i / kSteps;
    view.left = std::max(view.left, ray(0, v).x());
    view.right = std::min(view.right, ray(camera.width - 1.0, v).x());
    view.top = std::max(view.top, ray(u, 0).y());
    view.bottom = std::min(view.bottom, ray(u, camera.height - 1.0).y());
  }
  return view;
}

// A camera of the given size and fx : fy whose image lies within the view.
PinholeCamera CameraForView(const View& view, int width, int height, double fx_over_fy) {
  PinholeCamera camera;
  camera.width = width;
  camera.height = height;
  const double view_width = view.right - view.left, view_height = view.bottom - view.top;
  if (!(view_width > 1e-3 && view_height > 1e-3))
    throw InputError(
        "camera: the distortion leaves no usable view; check the distortion model and its coefficients");
  camera.fy = std::max((height - 1) / view_height, (width - 1) / view_width / fx_over_fy);
  camera.fx = camera.fy * fx_over_fy;
  camera.cx = 0.5 * (width - 1) - camera.fx * 0.5 * (view.left + view.right);
  camera.cy = 0.5 * (height - 1) - camera.fy * 0.5 * (view.top + view.bottom);
  return camera;
}

}  // namespace

Rectifier::Rectifier(const PinholeCamera& distorted) {
  if (distorted.distortion == Distortion::kNone) {
    target_ = distorted;
    target_.coefficients = {};
    identity_ = true;
    return;
  }
  const View view = InnerView(distorted, Eigen::Matrix3d::Identity());
  target_ = CameraForView(view, distorted.width, distorted.height, distorted.fx / distorted.fy);
  BuildTables(distorted, Eigen::Matrix3d::Identity());
}

Rectifier::Rectifier(const PinholeCamera& distorted, const PinholeCamera& target,
                     const Eigen::Matrix3d& R_rectified_camera)
    : target_(target) {
  BuildTables(distorted, R_rectified_camera.transpose());
}

void Rectifier::BuildTables(const PinholeCamera& distorted, const Eigen::Matrix3d& R_camera_rectified) {
  cv::Mat xy(target_.height, target_.width, CV_32FC2);
  for (int v = 0; v < target_.height; ++v) {
    for (int u = 0; u < target_.width; ++u) {
      const Eigen::Vector3d ray = R_camera_rectified * target_.Unproject({u, v});
      Eigen::Vector2d source(-1e4, -1e4);  // behind the camera: no source
      if (ray.z() > 1e-6) source = distorted.Project(ray);
      xy.at<cv::Vec2f>(v, u) = {static_cast<float>(source.x()), static_cast<float>(source.y())};
    }
  }
  cv::Mat unused;
  cv::convertMaps(xy, cv::noArray(), linear_xy_, linear_fraction_, CV_16SC2, false);
  cv::convertMaps(xy, cv::noArray(), nearest_xy_, unused, CV_16SC2, true);
}

cv::Mat Rectifier::Apply(const cv::Mat& image, Sampling sampling) const {
  if (identity_) return image;
  cv::Mat out;
  if (sampling == Sampling::kNearest) {
    cv::remap(image, out, nearest_xy_, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  } else {
    cv::remap(image, out, linear_xy_, linear_fraction_, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  }
  return out;
}

StereoRectification RectifyStereo(const PinholeCamera& left, const PinholeCamera& right,
                                  const Pose& T_right_left) {
  if (left.width != right.width || left.height != right.height)
    throw InputError("stereo calibration: the two cameras have different image sizes; they must be equal");
  // The right camera's position, seen from the left one.
  const Eigen::Vector3d position = T_right_left.Inverse().translation;
  if (!(position.x() > 0) || position.x() < position.tail<2>().norm())
    throw InputError(
        "stereo calibration: the second camera does not lie to the right of the first; swap the two");
  // cv::stereoRectify finds the two rotations; they depend on the extrinsics alone, so any intrinsics will do
  // here.
  const cv::Mat k = (cv::Mat_<double>(3, 3) << left.fx, 0, left.cx, 0, left.fy, left.cy, 0, 0, 1);
  cv::Mat rotation, translation, r_left, r_right, p_left, p_right, q;
  cv::eigen2cv(T_right_left.rotation.toRotationMatrix(), rotation);
  cv::eigen2cv(T_right_left.translation, translation);
  cv::stereoRectify(k, cv::noArray(), k, cv::noArray(), cv::Size(left.width, left.height), rotation,
                    translation, r_left, r_right, p_left, p_right, q);
  Eigen::Matrix3d R_left, R_right;
  cv::cv2eigen(r_left, R_left);
  cv::cv2eigen(r_right, R_right);
  const View a = InnerView(left, R_left), b = InnerView(right, R_right);
  const View common{std::max(a.left, b.left), std::min(a.right, b.right), std::max(a.top, b.top),
                    std::min(a.bottom, b.bottom)};
  const PinholeCamera target = CameraForView(common, left.width, left.height, 1.0);
  const Pose T_left_rectified(Eigen::Quaterniond(Eigen::Matrix3d(R_left.transpose())).normalized(),
                              Eigen::Vector3d::Zero());
  return {Rectifier(left, target, R_left), Rectifier(right, target, R_right), position.norm(),
          T_left_rectified};
}

}  // namespace tutti
