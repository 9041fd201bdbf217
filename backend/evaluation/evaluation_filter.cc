// Which poses are evaluated, and in which plane.
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/angle.h"
#include "tutti/backend/evaluation.h"

namespace tutti {

std::vector<std::size_t> EvenlySpacedPoses(std::size_t poses, std::size_t count) {
  std::vector<std::size_t> out;
  const bool all = poses <= count;
  const double step =
      all || count < 2 ? 1.0 : static_cast<double>(poses - 1) / static_cast<double>(count - 1);
  for (std::size_t k = 0; k < std::min(poses, count); ++k)
    out.push_back(static_cast<std::size_t>(std::floor(static_cast<double>(k) * step)));
  if (count > 1 && !all) out.back() = poses - 1;
  return out;
}

std::vector<std::size_t> MovedPoses(const Trajectory& trajectory, const MotionFilter& filter) {
  std::vector<std::size_t> out;
  double path = 0, path_of_last = 0;
  for (std::size_t k = 0; k < trajectory.size(); ++k) {
    const Pose& pose = trajectory[k].pose;
    if (k > 0) path += (pose.translation - trajectory[k - 1].pose.translation).norm();
    const bool counts =
        out.empty() || path - path_of_last >= filter.distance_m ||
        internal::kDegrees *
                LogSO3(trajectory[out.back()].pose.rotation.conjugate() * pose.rotation).norm() >=
            filter.angle_deg;
    if (!counts) continue;
    out.push_back(k);
    path_of_last = path;
  }
  return out;
}

Eigen::Vector3d RollPitchYaw(const Eigen::Matrix3d& R) {
  const double across = std::hypot(R(0, 0), R(1, 0)), pitch = std::atan2(-R(2, 0), across);
  if (across <= 4 * std::numeric_limits<double>::epsilon()) return {std::atan2(-R(1, 2), R(1, 1)), pitch, 0};
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

PoseMatrix ProjectToPlane(const PoseMatrix& pose, ProjectionPlane plane) {
  if (plane == ProjectionPlane::kNone) return pose;
  const int normal = plane == ProjectionPlane::kXY ? 2 : plane == ProjectionPlane::kXZ ? 1 : 0;
  PoseMatrix out = pose;
  out.translation[normal] = 0;
  const double angle = RollPitchYaw(pose.rotation)[normal];
  out.rotation = Eigen::AngleAxisd(angle, Eigen::Vector3d::Unit(normal)).toRotationMatrix();
  return out;
}

}  // namespace tutti
