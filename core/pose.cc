#include "tutti/core/pose.h"

#include <cmath>

#include "core/dense_solvers.h"

namespace tutti {

Eigen::Matrix3d Skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& rotation_vector) {
  const double angle_squared = rotation_vector.squaredNorm();
  // Taylor series near zero: sin(x/2)/x = 1/2 - x^2/48, cos(x/2) = 1 - x^2/8.
  if (angle_squared < 1e-12) {
    const double k = 0.5 - angle_squared / 48.0;
    return Eigen::Quaterniond(1.0 - angle_squared / 8.0, k * rotation_vector.x(), k * rotation_vector.y(),
                              k * rotation_vector.z())
        .normalized();
  }
  const double angle = std::sqrt(angle_squared);
  const double k = std::sin(0.5 * angle) / angle;
  return Eigen::Quaterniond(std::cos(0.5 * angle), k * rotation_vector.x(), k * rotation_vector.y(),
                            k * rotation_vector.z());
}

Eigen::Vector3d LogSO3(const Eigen::Quaterniond& rotation) {
  const double sign = rotation.w() < 0 ? -1.0 : 1.0;  // the short way round
  const Eigen::Vector3d v = sign * rotation.vec();
  const double w = sign * rotation.w();
  const double n = v.norm();
  if (n < 1e-9) return 2.0 / w * v;
  return 2.0 * std::atan2(n, w) / n * v;
}

Eigen::Matrix3d RightJacobianInverseSO3(const Eigen::Vector3d& v) {
  const double angle = v.norm();
  const Eigen::Matrix3d k = Skew(v);
  if (angle < 1e-5) return Eigen::Matrix3d::Identity() + 0.5 * k + k * k / 12.0;
  const double half = 0.5 * angle;
  const double b = (1.0 - half * std::cos(half) / std::sin(half)) / (angle * angle);
  return Eigen::Matrix3d::Identity() + 0.5 * k + b * k * k;
}

Pose Pose::FromMatrix(const Eigen::Matrix<double, 3, 4>& matrix) {
  const Eigen::Matrix3d r = matrix.leftCols<3>();
  const internal::Svd3 svd = internal::SingularValues(r);
  Eigen::Matrix3d d = Eigen::Matrix3d::Identity();
  d(2, 2) = (svd.u * svd.v.transpose()).determinant() < 0 ? -1.0 : 1.0;
  const Eigen::Matrix3d nearest = svd.u * d * svd.v.transpose();
  return Pose(Eigen::Quaterniond(nearest).normalized(), matrix.col(3));
}

Eigen::Matrix4d Pose::Matrix() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = rotation.toRotationMatrix();
  m.topRightCorner<3, 1>() = translation;
  return m;
}

Pose Pose::Inverse() const {
  const Eigen::Quaterniond inverse = rotation.conjugate();
  return Pose(inverse, -(inverse * translation));
}

Pose Pose::operator*(const Pose& other) const {
  return Pose((rotation * other.rotation).normalized(), rotation * other.translation + translation);
}

Similarity Similarity::Inverse() const {
  const Eigen::Quaterniond inverse = rotation.conjugate();
  return Similarity(1.0 / scale, inverse, -(1.0 / scale) * (inverse * translation));
}

Similarity Similarity::operator*(const Similarity& other) const {
  return Similarity(scale * other.scale, (rotation * other.rotation).normalized(),
                    scale * (rotation * other.translation) + translation);
}

namespace {
// V of the SE(3) exponential: t = V(w) u (Barfoot, State Estimation for Robotics, 7.86).
Eigen::Matrix3d LeftJacobianSO3(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  const Eigen::Matrix3d k = Skew(w);
  if (angle < 1e-5) return Eigen::Matrix3d::Identity() + 0.5 * k + k * k / 6.0;
  const double a = (1.0 - std::cos(angle)) / (angle * angle);
  const double b = (angle - std::sin(angle)) / (angle * angle * angle);
  return Eigen::Matrix3d::Identity() + a * k + b * k * k;
}
}  // namespace

Pose ExpSE3(const Vector6d& tangent) {
  const Eigen::Vector3d w = tangent.tail<3>();
  return Pose(ExpSO3(w), LeftJacobianSO3(w) * tangent.head<3>());
}

Vector6d LogSE3(const Pose& pose) {
  Vector6d tangent;
  const Eigen::Vector3d w = LogSO3(pose.rotation);
  // The inverse of the left Jacobian is the inverse of the right one at -w.
  tangent << RightJacobianInverseSO3(-w) * pose.translation, w;
  return tangent;
}

}  // namespace tutti
