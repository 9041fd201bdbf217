// The difference between where a camera sees a point and where it was measured. Not installed.
//
// R. Hartley and A. Zisserman, "Multiple View Geometry in Computer Vision", 2nd edition 2004, section 6.1;
// the derivatives: T. Barfoot, "State Estimation for Robotics", 2017, section 7.3.5.
#pragma once

#include <Eigen/Core>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti::internal {

/// Residual in N rows: image position (u, v) [px] and, with N = 3, inverse depth 1/z [1/m].
template <int N>
struct Reprojection {
  static_assert(N == 2 || N == 3);
  using Vector = Eigen::Matrix<double, N, 1>;
  using PointJacobian = Eigen::Matrix<double, N, 3>;
  using PoseJacobian = Eigen::Matrix<double, N, 6>;

  /// What was measured, and 1 / standard deviation of each row; a row with weight 0 does not count.
  struct Measurement {
    Vector value;
    Vector weight = Vector::Ones();
  };

  /// weight * (seen - measured) of a point in the camera frame. The camera's distortion is not used: pixels
  /// are those of a rectified image. False, and nothing is written, unless the point is farther than
  /// `min_depth` (> 0) in front of the camera. `by_point`: d residual / d point; may be null.
  static bool Residual(const PinholeCamera& camera, const Eigen::Vector3d& point, const Measurement& measured,
                       double min_depth, Vector* residual, PointJacobian* by_point) {
    if (!(point.z() > min_depth)) return false;
    const double iz = 1.0 / point.z(), x = point.x() * iz, y = point.y() * iz;
    const Vector& weight = measured.weight;
    (*residual)(0) = weight(0) * (camera.fx * x + camera.cx - measured.value(0));
    (*residual)(1) = weight(1) * (camera.fy * y + camera.cy - measured.value(1));
    if constexpr (N == 3) (*residual)(2) = weight(2) * (iz - measured.value(2));
    if (by_point == nullptr) return true;
    const double fx = weight(0) * camera.fx, fy = weight(1) * camera.fy;
    by_point->row(0) << fx * iz, 0, -fx * x * iz;
    by_point->row(1) << 0, fy * iz, -fy * y * iz;
    if constexpr (N == 3) by_point->row(2) << 0, 0, -weight(2) * iz * iz;
    return true;
  }

  /// d residual / d (translation, rotation) of a left perturbation, Exp(tangent) * T_camera_world: to the
  /// first order it moves the point in the camera frame by translation + rotation x point.
  static PoseJacobian ByPose(const PointJacobian& by_point, const Eigen::Vector3d& point) {
    PoseJacobian by_pose;
    by_pose.template leftCols<3>() = by_point;
    by_pose.template rightCols<3>() = -by_point * Skew(point);
    return by_pose;
  }
};

}  // namespace tutti::internal
