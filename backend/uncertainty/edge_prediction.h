// What do the other edges say about one: how far off may it be that is not in the graph yet, and how well
// does it agree with them that is? Private to the back end.
#pragma once

#include <cstddef>
#include <memory>
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
class EdgePrediction {
 public:
  virtual ~EdgePrediction() = default;

  /// Reads the weights and the poses. False if the edges of weight 1 do not hold the graph together.
  virtual bool Update() = 0;
  virtual PredictedEdge Of(std::size_t e) = 0;
};

/// `problem` outlives it.
std::unique_ptr<EdgePrediction> MakeEdgePrediction(const GraphProblem& problem);

/// Chi-square of each of these edges, all of weight 1, against the solution without it (the externally
/// studentised residual of regression diagnostics; Cook and Weisberg, 1982); `problem` is at an optimum of
/// its weights, each 0 or 1. With r the whitened error in the solution, H the graph's information matrix and
/// P = J H^-1 J^T it is r^T (I - P)^-1 r: to first order what the graph's cost falls by when the edge leaves.
/// A loop that has bent the graph to its liking has a small error and a large value here. Directions in which
/// nothing but the edge itself holds its ends (eigenvalue 1 of P) say nothing about it and do not count.
/// Empty if the edges of weight 1 do not hold the graph together.
std::vector<double> LeaveOneOutChi2(const GraphProblem& problem, const std::vector<std::size_t>& edges);

}  // namespace tutti::internal
