// How well does a loop agree with the rest of the graph? Private to the back end.
#pragma once

#include <utility>
#include <vector>

#include "backend/solver/graph_problem.h"
#include "backend/solver/linearized_edge.h"
#include "backend/uncertainty/selected_inverse.h"
#include "core/dense_solvers.h"

namespace tutti::internal {

/// Chi-square of each edge against the solution without it (the externally studentised residual of regression
/// diagnostics; Cook and Weisberg, 1982). With r the whitened error in the solution, H the graph's
/// information matrix and P = J H^-1 J^T it is r^T (I - P)^-1 r: to first order what the graph's cost falls
/// by when the edge leaves. A loop that has bent the graph to its liking has a small error and a large value
/// here. Directions in which nothing but the edge itself holds its ends (eigenvalue 1 of P) say nothing about
/// it and do not count.
template <int N>
class LeaveOneOut {
 public:
  /// `problem` at an optimum of its weights, each 0 or 1.
  LeaveOneOut(const GraphProblem<N>& problem, std::size_t edges)
      : problem_(problem),
        row_(NumberRows<N>(problem.structure().constant, size_)),
        inverse_(Information(edges)) {}

  /// False if the edges of weight 1 do not hold the graph together.
  bool Ok() const { return inverse_.Ok(); }

  /// Of an edge of weight 1.
  double Chi2(std::size_t e) const {
    using Square = Eigen::Matrix<double, N, N>;
    const LinearizedEdge<N> edge = problem_.Linearized(e);
    const auto [from, to] = problem_.structure().ends[e];
    const int at[2] = {row_[from], row_[to]};
    Square P = Square::Zero();
    for (int a = 0; a < 2; ++a) {
      for (int b = 0; b < 2; ++b) {
        if (at[a] >= 0 && at[b] >= 0)
          P += edge.jacobian[a] * Covariance(at[a], at[b]) * edge.jacobian[b].transpose();
      }
    }
    const Eigenpairs eigen = SymmetricEigen(P);
    const Eigen::Matrix<double, N, 1> error = eigen.vectors.transpose() * edge.error;
    double sum = 0;
    for (int k = 0; k < N; ++k) {
      const double rest = 1 - eigen.values(k);
      if (rest > kLeastHold) sum += error(k) * error(k) / rest;
    }
    return sum;
  }

 private:
  static constexpr double kLeastHold = 1e-6;  // below it rounding decides

  Eigen::SparseMatrix<double> Information(std::size_t edges) const {
    std::vector<Eigen::Triplet<double>> triplets;
    for (std::size_t e = 0; e < edges; ++e) {
      if (problem_.weight(e) == 0) continue;
      const auto [from, to] = problem_.structure().ends[e];
      AddInformation<N>(problem_.Linearized(e), {row_[from], row_[to]}, triplets);
    }
    Eigen::SparseMatrix<double> H(size_, size_);
    H.setFromTriplets(triplets.begin(), triplets.end());
    return H;
  }

  Eigen::Matrix<double, N, N> Covariance(int r, int c) const {
    Eigen::Matrix<double, N, N> out;
    for (int i = 0; i < N; ++i) {
      for (int k = 0; k < N; ++k) out(i, k) = inverse_.At(r + i, c + k);
    }
    return out;
  }

  const GraphProblem<N>& problem_;
  int size_ = 0;  // before row_, which sets it
  std::vector<int> row_;
  SelectedInverse inverse_;
};

}  // namespace tutti::internal
