// The error of one edge and its analytic Jacobians. Private to the back end.
//
// E = S_ij^-1 S_i^-1 S_j, and with d = R_i^T (t_j - t_i) / s_i
//   t(E) = R_ij^T (d - t_ij) / s_ij,   R(E) = R_ij^T R_i^T R_j,   log s(E) = log s_j - log s_i - log s_ij.
// Nodes move by t + dt, R Exp(dr), log s + dls; hence
//   dt(E)/dt_j = A, dt(E)/dt_i = -A with A = R_ij^T R_i^T / (s_i s_ij);  dt(E)/dr_i = R_ij^T [d]x / s_ij;
//   dt(E)/dls_i = -R_ij^T d / s_ij;  drot(E)/dr_j = J,  drot(E)/dr_i = -J R_j^T R_i,
// with J = Jr^-1(rotation vector) for chi2log and J = (w I + [v]x) / 2 for chi2 (q = (v, w), w >= 0).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// Heading of a rotation about z [rad], (-pi, pi].
inline double Heading(const Eigen::Quaterniond& q) { return 2.0 * std::atan2(q.z(), q.w()); }
inline double WrapAngle(double a) { return a - 2.0 * M_PI * std::floor((a + M_PI) / (2.0 * M_PI)); }

/// Rows and columns of PoseGraphEdge::information in solver order.
template <int N>
inline std::array<int, N> SolverOrder() {
  if constexpr (N == 3) return {0, 1, 5};
  if constexpr (N == 6) return {0, 1, 2, 3, 4, 5};
  if constexpr (N == 7) return {0, 1, 2, 6, 3, 4, 5};
}

/// The part of an information matrix that edges of N coordinates use.
template <int N>
Eigen::Matrix<double, N, N> InSolverOrder(const Matrix7d& information) {
  const std::array<int, N> order = SolverOrder<N>();
  return information(order, order);
}

/// Whitened error r = S e of one edge, and its Jacobians S de/dx with respect to its two ends.
template <int N>
struct LinearizedEdge {
  Eigen::Matrix<double, N, 1> error;
  Eigen::Matrix<double, N, N> jacobian[2];
};

/// The error of one edge as a function of its two ends, and what it needs again and again. Coordinates of the
/// error and the tangent are in *solver order*: kSE2 (x, y, heading), kSE3 (t, r), kSim3 (t, log s, r).
/// Blocks: [x, y, heading], [t, q] or [t, log s, q]. For N = 3, 6, 7, as all below: edge_error.cc alone
/// compiles them.
template <int N>
struct EdgeError {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Square = Eigen::Matrix<double, N, N>;

  EdgeError(const PoseGraphEdge& edge, GraphObjective objective);

  /// The error, not whitened; its Jacobians with respect to the two tangents where asked for (null: not).
  void Evaluate(const double* block_i, const double* block_j, Vector& error, Square* jacobian_i,
                Square* jacobian_j) const;
  /// Whitened: r = S e.
  void EvaluateWhitened(const double* block_i, const double* block_j, Vector& residual, Square* jacobian_i,
                        Square* jacobian_j) const;
  LinearizedEdge<N> Linearized(const double* block_i, const double* block_j) const {
    LinearizedEdge<N> out;
    EvaluateWhitened(block_i, block_j, out.error, &out.jacobian[0], &out.jacobian[1]);
    return out;
  }

  Eigen::Quaterniond rotation_inverse;  ///< R_ij^-1
  Eigen::Matrix3d rotation_transposed;  ///< R_ij^T
  Eigen::Vector3d translation;          ///< t_ij
  double inverse_scale = 1, log_scale = 0;
  double heading = 0;                            ///< kSE2
  Eigen::Matrix<double, N, N> sqrt_information;  ///< S with S^T S = information: the *upper* Cholesky factor
  bool log_rotation = true;                      ///< chi2log
};

/// Number of doubles of a node's block.
template <int N>
constexpr int BlockSize() {
  return N == 3 ? 3 : N + 1;
}

template <int N>
void PoseToBlock(const Similarity& pose, double* block);

template <int N>
Similarity BlockToPose(const double* block);

}  // namespace tutti::internal
