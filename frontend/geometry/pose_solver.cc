#include "frontend/geometry/pose_solver.h"

#include <cmath>
#include <opencv2/calib3d.hpp>

#include "core/least_squares.h"

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
  inlier->assign(observations.size(), 1);
  int inliers = 0;
  for (int round = 0; round < 4; ++round) {
    const bool robust = round < 3;
    const auto linearise = [&](internal::NormalEquations<6>& equations) {
      for (std::size_t i = 0; i < observations.size(); ++i) {
        if (!(*inlier)[i]) continue;
        Eigen::Vector3d r;
        Eigen::Matrix<double, 3, 6> j;
        if (!ReprojectionResidual(camera, *T_camera_world, observations[i], &r, &j)) continue;
        const double s = r.squaredNorm(), bound = robust ? ChiSquareBound(observations[i]) : INFINITY;
        equations.Add(j, r, internal::HuberWeight(s, bound));
        equations.cost += internal::HuberCost(s, bound);
      }
    };
    // Left perturbation: translation and rotation act on the point in the camera frame.
    const auto move = [&](const Vector6d& step) {
      *T_camera_world = Pose(ExpSO3(step.tail<3>()), step.head<3>()) * *T_camera_world;
      return true;
    };
    internal::GaussNewton<6>(kLimits, linearise, move);
    inliers = 0;
    for (std::size_t i = 0; i < observations.size(); ++i) {
      Eigen::Vector3d r;
      (*inlier)[i] = ReprojectionResidual(camera, *T_camera_world, observations[i], &r, nullptr) &&
                     r.squaredNorm() <= ChiSquareBound(observations[i]);
      inliers += (*inlier)[i];
    }
    if (inliers < 4) break;
  }
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
