#include "frontend/geometry/pose_solver.h"

#include <opencv2/calib3d.hpp>

namespace tutti {
namespace {

// The damping holds a pose that the points do not.
constexpr internal::GaussNewtonLimits kLimits{10, 1e-7, 1e-5, 1e-9};

}  // namespace

bool ReprojectionResidual(const PinholeCamera& camera, const Pose& T_camera_world, const PointObservation& o,
                          Eigen::Vector3d* residual, Eigen::Matrix<double, 3, 6>* jacobian) {
  const Eigen::Vector3d p = T_camera_world * o.point;
  internal::Reprojection<3>::PointJacobian by_point;
  if (!internal::Reprojection<3>::Residual(camera, p, InSigmas(o), kMinDepth, residual,
                                           jacobian != nullptr ? &by_point : nullptr))
    return false;
  if (jacobian != nullptr) *jacobian = internal::Reprojection<3>::ByPose(by_point, p);
  return true;
}

int RefinePose(const PinholeCamera& camera, const std::vector<PointObservation>& observations,
               Pose* T_camera_world, std::vector<char>* inlier) {
  const auto residual = [&](const PointObservation& o, Eigen::Vector3d* r, Eigen::Matrix<double, 3, 6>* j) {
    return ReprojectionResidual(camera, *T_camera_world, o, r, j);
  };
  // Left perturbation: translation and rotation act on the point in the camera frame.
  const auto move = [&](const Vector6d& step) {
    *T_camera_world = Pose(ExpSO3(step.tail<3>()), step.head<3>()) * *T_camera_world;
    return true;
  };
  const auto no_prior = [](internal::NormalEquations<6>*) {};
  const int inliers = RefineOnInliers<6>(observations, kLimits, 4, residual, no_prior, move, inlier);
  if (!T_camera_world->IsFinite()) {
    *T_camera_world = Pose();
    inlier->assign(observations.size(), 0);
    return 0;
  }
  return inliers;
}

std::optional<Pose> SolvePnp(const PinholeCamera& camera, const std::vector<Eigen::Vector3d>& points,
                             const std::vector<cv::Point2f>& pixels, int least_inliers) {
  std::vector<cv::Point3d> objects;
  objects.reserve(points.size());
  for (const Eigen::Vector3d& p : points) objects.emplace_back(p.x(), p.y(), p.z());
  const std::vector<cv::Point2d> images(pixels.begin(), pixels.end());
  const cv::Matx33d k(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  cv::Mat rvec, tvec;
  std::vector<int> inliers;
  try {
    if (!cv::solvePnPRansac(objects, images, cv::Mat(k), cv::noArray(), rvec, tvec, false, 200, 5.0F, 0.99,
                            inliers))
      return std::nullopt;
  } catch (const cv::Exception&) {
    return std::nullopt;  // degenerate points; OpenCV has no other way to say so
  }
  if (static_cast<int>(inliers.size()) < least_inliers) return std::nullopt;
  const Eigen::Vector3d w(rvec.at<double>(0), rvec.at<double>(1), rvec.at<double>(2));
  const Pose pose(ExpSO3(w), {tvec.at<double>(0), tvec.at<double>(1), tvec.at<double>(2)});
  return pose.IsFinite() ? std::optional(pose) : std::nullopt;
}

}  // namespace tutti
