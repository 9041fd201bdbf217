// One edge in the graph's system of equations. Private to the back end.
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "backend/solver/graph_solver.h"

namespace tutti::internal {

/// Whitened error r = S e of one edge, and its Jacobians S de/dx with respect to its two ends, solver order.
template <int N>
struct LinearizedEdge {
  Eigen::Matrix<double, N, 1> error;
  Eigen::Matrix<double, N, N> jacobian[2];
};

template <int N>
LinearizedEdge<N> Linearize(const EdgeConstants<N>& constants, const double* from, const double* to) {
  LinearizedEdge<N> out;
  WhitenedError<N>(constants, from, to, out.error, &out.jacobian[0], &out.jacobian[1]);
  return out;
}

/// First row of each node among N unknowns a node; -1: held in place. `size`: how many rows there are.
template <int N>
std::vector<int> NumberRows(const std::vector<bool>& constant, int& size) {
  std::vector<int> out;
  size = 0;
  for (const bool held : constant) {
    out.push_back(held ? -1 : size);
    size += held ? 0 : N;
  }
  return out;
}

/// Adds J^T J of an edge whose ends' unknowns start at rows `at` to the lower triangle of the information
/// matrix.
template <int N>
void AddInformation(const LinearizedEdge<N>& edge, const int (&at)[2],
                    std::vector<Eigen::Triplet<double>>& to) {
  for (int a = 0; a < 2; ++a) {
    for (int b = 0; b < 2; ++b) {
      if (at[a] < 0 || at[b] < 0 || at[a] < at[b]) continue;
      const Eigen::Matrix<double, N, N> H = edge.jacobian[a].transpose() * edge.jacobian[b];
      for (int r = 0; r < N; ++r) {
        for (int c = 0; c < N; ++c) to.emplace_back(at[a] + r, at[b] + c, H(r, c));
      }
    }
  }
}

}  // namespace tutti::internal
