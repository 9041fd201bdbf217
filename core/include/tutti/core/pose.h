// Rigid and similarity transforms, and their exponential maps.
//
// Naming: T_a_b maps points of frame b into frame a: p_a = T_a_b * p_b, and T_a_c = T_a_b * T_b_c.
// Camera frames: x right, y down, z forward. Lengths in metres (mono: in units of the initial scale).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#pragma GCC visibility push(default)
namespace tutti {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

/// Skew-symmetric matrix [v]x with [v]x w = v x w.
Eigen::Matrix3d Skew(const Eigen::Vector3d& v);

/// SO(3) exponential: unit quaternion of the rotation vector (radians).
Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& rotation_vector);

/// SO(3) logarithm: rotation vector (radians), norm in [0, pi].
Eigen::Vector3d LogSO3(const Eigen::Quaterniond& rotation);

/// Inverse of the right Jacobian of SO(3): Log(Exp(v) Exp(d)) ~ v + Jr^-1(v) d.
Eigen::Matrix3d RightJacobianInverseSO3(const Eigen::Vector3d& rotation_vector);

/// Rigid transform T_a_b in SE(3).
struct Pose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< unit quaternion R_a_b
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();         ///< origin of b in a [m]

  Pose() = default;
  Pose(const Eigen::Quaterniond& r, const Eigen::Vector3d& t) : rotation(r), translation(t) {}
  /// From a 4x4 or 3x4 matrix [R|t]; R is projected to the nearest rotation.
  static Pose FromMatrix(const Eigen::Matrix<double, 3, 4>& matrix);
  Eigen::Matrix4d Matrix() const;

  Pose Inverse() const;
  Pose operator*(const Pose& other) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return rotation * point + translation; }

  /// Rotation angle in radians, [0, pi].
  double Angle() const { return LogSO3(rotation).norm(); }
  /// True if every number is finite.
  bool IsFinite() const { return rotation.coeffs().allFinite() && translation.allFinite(); }
};

/// Similarity transform S_a_b in Sim(3): p_a = scale * R * p_b + t.
struct Similarity {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Similarity() = default;
  Similarity(double s, const Eigen::Quaterniond& r, const Eigen::Vector3d& t)
      : scale(s), rotation(r), translation(t) {}
  explicit Similarity(const Pose& pose) : rotation(pose.rotation), translation(pose.translation) {}

  Similarity Inverse() const;
  Similarity operator*(const Similarity& other) const;
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const {
    return scale * (rotation * point) + translation;
  }
  /// The rigid part with the translation as it is (drops the scale).
  Pose RigidPart() const { return Pose(rotation, translation); }
};

/// SE(3) exponential and logarithm; the tangent is (translation, rotation vector), in that order.
Pose ExpSE3(const Vector6d& tangent);
Vector6d LogSE3(const Pose& pose);

}  // namespace tutti
#pragma GCC visibility pop
