// How far off may an edge be that is not in the graph yet? Private to the back end.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstddef>
#include <vector>

#include "backend/solver/graph_problem.h"

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
  explicit EdgePrediction(const GraphProblem<N>& problem);

  /// Reads the weights and the poses. False if the edges of weight 1 do not hold the graph together.
  bool Update();

  PredictedEdge Of(std::size_t e);

 private:
  using Square = Eigen::Matrix<double, N, N>;
  using Row = Eigen::Matrix<double, 1, N>;
  static std::size_t At(int k) { return static_cast<std::size_t>(k); }

  /// The way from a column to the root, as far as it is new.
  void ClimbFrom(int column, std::vector<int>& columns);
  void Eliminate(int column);

  const GraphProblem<N>& problem_;
  int size_ = 0;  // before row_, which sets it
  std::vector<int> row_;
  Eigen::SparseMatrix<double> L_;  // the factor, permuted
  Eigen::VectorXi place_;          // of each row of H in L
  std::vector<Row> solution_;      // zero between calls
  std::vector<bool> reached_;      // false between calls
};

extern template class EdgePrediction<3>;
extern template class EdgePrediction<6>;
extern template class EdgePrediction<7>;

}  // namespace tutti::internal
