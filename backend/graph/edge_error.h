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

/// What an edge needs again and again. Coordinates of the error and the tangent are in *solver order*:
/// kSE2 (x, y, heading), kSE3 (t, r), kSim3 (t, log s, r).
template <int N>
struct EdgeConstants {
  Eigen::Quaterniond rotation_inverse;  ///< R_ij^-1
  Eigen::Matrix3d rotation_transposed;  ///< R_ij^T
  Eigen::Vector3d translation;          ///< t_ij
  double inverse_scale = 1, log_scale = 0;
  double heading = 0;                            ///< kSE2
  Eigen::Matrix<double, N, N> sqrt_information;  ///< S with S^T S = information: the *upper* Cholesky factor
  bool log_rotation = true;                      ///< chi2log
};

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

/// For N = 3, 6, 7, as all below: edge_error.cc alone compiles them.
template <int N>
EdgeConstants<N> MakeEdgeConstants(const PoseGraphEdge& edge, GraphObjective objective);

/// Error of an edge, not whitened. Blocks: [x, y, heading], [t, q] or [t, log s, q]. Jacobians (N x N, solver
/// order) may be null.
template <int N>
void EdgeError(const EdgeConstants<N>& c, const double* block_i, const double* block_j,
               Eigen::Matrix<double, N, 1>& error, Eigen::Matrix<double, N, N>* jacobian_i,
               Eigen::Matrix<double, N, N>* jacobian_j);

/// Whitened error r = S e of one edge; its Jacobians with respect to the two tangents where asked for (null:
/// not).
template <int N>
void WhitenedError(const EdgeConstants<N>& constants, const double* block_i, const double* block_j,
                   Eigen::Matrix<double, N, 1>& residual, Eigen::Matrix<double, N, N>* jacobian_i,
                   Eigen::Matrix<double, N, N>* jacobian_j);

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
