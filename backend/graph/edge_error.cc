#include "backend/graph/edge_error.h"

#include <Eigen/Geometry>

#include "core/dense_solvers.h"

namespace tutti::internal {

template <int N>
EdgeError<N>::EdgeError(const PoseGraphEdge& edge, GraphObjective objective) {
  const Similarity& m = edge.measurement;
  rotation_inverse = m.rotation.conjugate();
  rotation_transposed = rotation_inverse.toRotationMatrix();
  translation = m.translation;
  inverse_scale = N == 7 ? 1.0 / m.scale : 1.0;
  log_scale = N == 7 ? std::log(m.scale) : 0.0;
  heading = N == 3 ? Heading(m.rotation) : 0.0;
  sqrt_information = UpperCholesky(InSolverOrder<N>(edge.information)).upper;
  log_rotation = objective == GraphObjective::kChi2Log;
}

namespace {

// The error of an edge in space: N = 6 or 7.
template <int N>
void EvaluateInSpace(const EdgeError<N>& c, const double* block_i, const double* block_j,
                     Eigen::Matrix<double, N, 1>& error, Eigen::Matrix<double, N, N>* jacobian_i,
                     Eigen::Matrix<double, N, N>* jacobian_j) {
  constexpr int kRotation = N - 3;
  const Eigen::Map<const Eigen::Vector3d> ti(block_i), tj(block_j);
  const Eigen::Map<const Eigen::Quaterniond> qi(block_i + kRotation), qj(block_j + kRotation);
  const double inverse_scale_i = N == 7 ? std::exp(-block_i[3]) : 1.0;
  const Eigen::Matrix3d Ri_transposed = qi.conjugate().toRotationMatrix();
  const Eigen::Vector3d d = inverse_scale_i * (Ri_transposed * (tj - ti));
  const Eigen::Quaterniond q_i_j = qi.conjugate() * qj;
  const Eigen::Quaterniond q = c.rotation_inverse * q_i_j;
  error.template head<3>() = c.inverse_scale * (c.rotation_transposed * (d - c.translation));
  if constexpr (N == 7) error(3) = block_j[3] - block_i[3] - c.log_scale;
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d rotation = c.log_rotation ? LogSO3(q) : Eigen::Vector3d(sign * q.vec());
  error.template tail<3>() = rotation;
  if (jacobian_i == nullptr && jacobian_j == nullptr) return;

  const Eigen::Matrix3d A = (c.inverse_scale * inverse_scale_i) * (c.rotation_transposed * Ri_transposed);
  Eigen::Matrix3d J;
  if (c.log_rotation) {
    J = RightJacobianInverseSO3(rotation);
  } else {
    J = 0.5 * (sign * q.w() * Eigen::Matrix3d::Identity() + Skew(rotation));
  }
  if (jacobian_j != nullptr) {
    jacobian_j->setZero();
    jacobian_j->template topLeftCorner<3, 3>() = A;
    if constexpr (N == 7) (*jacobian_j)(3, 3) = 1.0;
    jacobian_j->template bottomRightCorner<3, 3>() = J;
  }
  if (jacobian_i != nullptr) {
    jacobian_i->setZero();
    jacobian_i->template topLeftCorner<3, 3>() = -A;
    const Eigen::Matrix3d M = c.inverse_scale * c.rotation_transposed;
    jacobian_i->template topRightCorner<3, 3>() = M * Skew(d);
    if constexpr (N == 7) {
      jacobian_i->template block<3, 1>(0, 3) = -(M * d);
      (*jacobian_i)(3, 3) = -1.0;
    }
    jacobian_i->template bottomRightCorner<3, 3>() = -J * q_i_j.conjugate().toRotationMatrix();
  }
}

void EvaluateInPlane(const EdgeError<3>& c, const double* block_i, const double* block_j,
                     Eigen::Vector3d& error, Eigen::Matrix3d* jacobian_i, Eigen::Matrix3d* jacobian_j) {
  const double ci = std::cos(block_i[2]), si = std::sin(block_i[2]);
  const Eigen::Vector2d step(block_j[0] - block_i[0], block_j[1] - block_i[1]);
  Eigen::Matrix2d Ri_transposed;
  Ri_transposed << ci, si, -si, ci;
  const Eigen::Matrix2d M = c.rotation_transposed.topLeftCorner<2, 2>();
  const Eigen::Vector2d d = Ri_transposed * step;
  error.head<2>() = M * (d - c.translation.head<2>());
  error(2) = WrapAngle(block_j[2] - block_i[2] - c.heading);
  const Eigen::Matrix2d A = M * Ri_transposed;
  if (jacobian_j != nullptr) {
    *jacobian_j << A(0, 0), A(0, 1), 0, A(1, 0), A(1, 1), 0, 0, 0, 1;
  }
  if (jacobian_i != nullptr) {
    const Eigen::Vector2d turn = M * Eigen::Vector2d(d.y(), -d.x());  // d(R_i^T step)/dheading
    *jacobian_i << -A(0, 0), -A(0, 1), turn.x(), -A(1, 0), -A(1, 1), turn.y(), 0, 0, -1;
  }
}

}  // namespace

template <int N>
void EdgeError<N>::Evaluate(const double* block_i, const double* block_j, Vector& error, Square* jacobian_i,
                            Square* jacobian_j) const {
  if constexpr (N == 3) {
    EvaluateInPlane(*this, block_i, block_j, error, jacobian_i, jacobian_j);
  } else {
    EvaluateInSpace<N>(*this, block_i, block_j, error, jacobian_i, jacobian_j);
  }
}

template <int N>
void EdgeError<N>::EvaluateWhitened(const double* block_i, const double* block_j, Vector& residual,
                                    Square* jacobian_i, Square* jacobian_j) const {
  Vector error;
  Square J[2];
  Evaluate(block_i, block_j, error, jacobian_i != nullptr ? &J[0] : nullptr,
           jacobian_j != nullptr ? &J[1] : nullptr);
  residual.noalias() = sqrt_information * error;
  if (jacobian_i != nullptr) jacobian_i->noalias() = sqrt_information * J[0];
  if (jacobian_j != nullptr) jacobian_j->noalias() = sqrt_information * J[1];
}

template <int N>
void PoseToBlock(const Similarity& pose, double* block) {
  if constexpr (N == 3) {
    block[0] = pose.translation.x();
    block[1] = pose.translation.y();
    block[2] = Heading(pose.rotation);
  } else {
    Eigen::Map<Eigen::Vector3d>{block} = pose.translation;
    if constexpr (N == 7) block[3] = std::log(pose.scale);
    Eigen::Map<Eigen::Quaterniond>{block + N - 3} = pose.rotation;
  }
}

template <int N>
Similarity BlockToPose(const double* block) {
  Similarity pose;
  if constexpr (N == 3) {
    pose.translation = Eigen::Vector3d(block[0], block[1], 0);
    pose.rotation = Eigen::Quaterniond(std::cos(0.5 * block[2]), 0, 0, std::sin(0.5 * block[2]));
  } else {
    pose.translation = Eigen::Map<const Eigen::Vector3d>(block);
    if constexpr (N == 7) pose.scale = std::exp(block[3]);
    pose.rotation = Eigen::Map<const Eigen::Quaterniond>(block + N - 3).normalized();
  }
  return pose;
}

template struct EdgeError<3>;
template struct EdgeError<6>;
template struct EdgeError<7>;
template void PoseToBlock<3>(const Similarity&, double*);
template void PoseToBlock<6>(const Similarity&, double*);
template void PoseToBlock<7>(const Similarity&, double*);
template Similarity BlockToPose<3>(const double*);
template Similarity BlockToPose<6>(const double*);
template Similarity BlockToPose<7>(const double*);

}  // namespace tutti::internal
