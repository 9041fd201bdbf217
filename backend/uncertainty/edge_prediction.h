// How far off may an edge be that is not in the graph yet? Private to the back end.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "backend/solver/graph_problem.h"
#include "backend/solver/linearized_edge.h"

namespace tutti::internal {

/// What the other edges say about one edge.
struct PredictedEdge {
  double chi2 = 0;    ///< of its error, by its own covariance and that of the graph [1]
  double spread = 0;  ///< log of the determinant of both together, as a multiple of its own; >= 0 [1]
};

/// With r the whitened error of an edge of weight 0, J its Jacobian and H the information matrix of the edges
/// of weight 1, r has the covariance S = I + J H^-1 J^T: chi2 is r^T S^-1 r, to first order what the cost of
/// the graph rises by if the edge joins it (the innovation of a Kalman filter). L^-1 J^T of the Cholesky
/// factor H = L L^T is enough, and has entries only on the ways of the edge's ends to the root of the
/// elimination tree.
template <int N>
class EdgePrediction {
 public:
  explicit EdgePrediction(const GraphProblem<N>& problem)
      : problem_(problem), row_(NumberRows<N>(problem.structure().constant, size_)) {}

  /// Reads the weights and the poses. False if the edges of weight 1 do not hold the graph together.
  bool Update() {
    std::vector<Eigen::Triplet<double>> triplets;
    for (std::size_t e = 0; e < problem_.structure().ends.size(); ++e) {
      if (problem_.weight(e) == 0) continue;
      const auto [from, to] = problem_.structure().ends[e];
      AddInformation<N>(problem_.Linearized(e), {row_[from], row_[to]}, triplets);
    }
    Eigen::SparseMatrix<double> H(size_, size_);
    H.setFromTriplets(triplets.begin(), triplets.end());
    const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor(H);
    if (factor.info() != Eigen::Success) return false;
    L_ = factor.matrixL();
    place_ = factor.permutationP().indices();
    solution_.assign(static_cast<std::size_t>(size_), Row::Zero());
    reached_.assign(static_cast<std::size_t>(size_), false);
    return true;
  }

  PredictedEdge Of(std::size_t e) {
    const LinearizedEdge<N> edge = problem_.Linearized(e);
    const auto [from, to] = problem_.structure().ends[e];
    const std::size_t ends[2] = {from, to};
    std::vector<int> columns;
    for (int a = 0; a < 2; ++a) {
      for (int k = 0; k < N && row_[ends[a]] >= 0; ++k) {
        const int place = place_[row_[ends[a]] + k];
        ClimbFrom(place, columns);
        solution_[At(place)] += edge.jacobian[a].col(k).transpose();
      }
    }
    std::sort(columns.begin(), columns.end());
    Square S = Square::Identity();
    for (const int column : columns) {
      Eliminate(column);
      S += solution_[At(column)].transpose() * solution_[At(column)];
    }
    for (const int column : columns) {
      solution_[At(column)].setZero();
      reached_[At(column)] = false;
    }
    const Eigen::LLT<Square> factor(S);
    return {edge.error.dot(factor.solve(edge.error)), 2 * factor.matrixLLT().diagonal().array().log().sum()};
  }

 private:
  using Square = Eigen::Matrix<double, N, N>;
  using Row = Eigen::Matrix<double, 1, N>;
  static std::size_t At(int k) { return static_cast<std::size_t>(k); }

  /// The way from a column to the root, as far as it is new.
  void ClimbFrom(int column, std::vector<int>& columns) {
    while (!reached_[At(column)]) {
      reached_[At(column)] = true;
      columns.push_back(column);
      const int below = L_.outerIndexPtr()[column] + 1;
      if (below == L_.outerIndexPtr()[column + 1]) return;
      column = L_.innerIndexPtr()[below];
    }
  }

  void Eliminate(int column) {
    const int begin = L_.outerIndexPtr()[column], end = L_.outerIndexPtr()[column + 1];
    const Row value = solution_[At(column)] / L_.valuePtr()[begin];
    solution_[At(column)] = value;
    for (int k = begin + 1; k < end; ++k) solution_[At(L_.innerIndexPtr()[k])] -= L_.valuePtr()[k] * value;
  }

  const GraphProblem<N>& problem_;
  int size_ = 0;  // before row_, which sets it
  std::vector<int> row_;
  Eigen::SparseMatrix<double> L_;  // the factor, permuted
  Eigen::VectorXi place_;          // of each row of H in L
  std::vector<Row> solution_;      // zero between calls
  std::vector<bool> reached_;      // false between calls
};

}  // namespace tutti::internal
