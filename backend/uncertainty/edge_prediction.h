// How far off may an edge be that is not in the graph yet? Private to the back end.
#pragma once

#include <cstddef>
#include <memory>

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

}  // namespace tutti::internal
