// The costs of landmarks' measurements and of priors. Private to the back end.
#pragma once

#include <ceres/cost_function.h>
#include <ceres/problem.h>

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

#include "backend/graph/edge_error.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// What a graph measures besides its edges, and its landmarks, which are variables of the problem. For N = 3,
/// 6, 7; measurement_terms.cc alone compiles it.
template <int N>
class MeasurementTerms {
 public:
  static constexpr int kPoint = N == 3 ? 2 : 3;  ///< coordinates of a landmark

  MeasurementTerms(const PoseGraph& graph, GraphObjective objective);

  Eigen::Vector3d Landmark(std::size_t k) const;
  void SetLandmark(std::size_t k, const Eigen::Vector3d& position);

  /// Sum of e^T Omega e over all measurements; `blocks`: the nodes, BlockSize<N>() numbers each.
  double Chi2(const double* blocks) const;
  /// `problem` knows the nodes' blocks. It refers to this object from then on, and does not own the costs.
  void AddTo(ceres::Problem& problem, double* blocks);

 private:
  struct Term {
    std::unique_ptr<ceres::CostFunction> cost;
    std::vector<std::size_t> nodes, landmarks;  // positions; a term has its nodes first
  };
  std::vector<const double*> Parameters(const Term& term, const double* blocks) const;

  std::vector<Term> terms_;
  std::vector<double> points_;  // kPoint numbers each
  std::vector<bool> fixed_;
};

/// The sum over the measurements of a graph at these poses, of its nodes and behind them its landmarks.
double MeasurementChi2(const PoseGraph& graph, GraphObjective objective,
                       const std::vector<Similarity>& poses);

}  // namespace tutti::internal
