// The weighted least-squares problem of a pose graph in numbers, and the interface of who solves it. Private
// to the back end.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <cstddef>
#include <memory>
#include <vector>

#include "backend/graph/edge_error.h"
#include "backend/solver/graph_problem.h"
#include "backend/solver/measurement_terms.h"

namespace tutti::internal {

template <int N>
class WeightedGraph;

/// Moves the nodes of a graph to a local minimum. May keep what depends on the pattern alone from one call to
/// the next, hence is to be used with one graph.
template <int N>
class GraphSolver {
 public:
  virtual ~GraphSolver() = default;
  virtual SolveSummary Solve(WeightedGraph<N>& graph, const SolveLimits& limits) = 0;
};

/// For N = 3, 6, 7; ceres_solver.cc and block_solver.cc alone compile them.
template <int N>
std::unique_ptr<GraphSolver<N>> MakeCeresSolver();
template <int N>
std::unique_ptr<GraphSolver<N>> MakeBlockSolver();

/// A graph problem whose nodes have N coordinates: 3, 6 or 7; graph_problem.cc alone compiles it.
template <int N>
class WeightedGraph final : public GraphProblem {
 public:
  static constexpr int kDimension = N;
  static constexpr std::size_t kBlock = static_cast<std::size_t>(BlockSize<N>());

  WeightedGraph(const PoseGraph& graph, const GraphStructure& structure, const PoseGraphOptions& options);

  void SetPoses(const std::vector<Similarity>& poses) override;
  std::vector<Similarity> Poses() const override;
  double EdgeChi2(std::size_t e) const override;

  /// A node's block.
  const double* Block(std::size_t node) const { return &blocks_[node * kBlock]; }
  double* Block(std::size_t node) { return &blocks_[node * kBlock]; }
  double* blocks() { return blocks_.data(); }
  const EdgeError<N>& Edge(std::size_t e) const { return edges_[e]; }
  /// Landmarks and priors, always of weight 1; Ceres knows them.
  MeasurementTerms<N>& terms() { return terms_; }

  LinearizedEdge<N> Linearized(std::size_t e) const {
    const EdgeEnds& ends = structure().ends[e];
    return edges_[e].Linearized(Block(ends.from), Block(ends.to));
  }
  /// rho of an edge from its chi-square; `pull` is what multiplies its normal equations.
  double Loss(std::size_t e, double chi2, double& pull) const;

  /// J^T J of the edges that count, lower triangle: the rows of a node begin at N times its place in
  /// `unknown` (NumberUnknowns).
  Eigen::SparseMatrix<double> InformationMatrix(const std::vector<int>& unknown) const;

 private:
  double MeasurementChi2() const override { return terms_.Chi2(blocks_.data()); }
  SolveSummary Minimise(const SolveLimits& limits) override { return solver_->Solve(*this, limits); }

  std::vector<EdgeError<N>> edges_;
  std::vector<double> blocks_;  // kBlock numbers for each node
  MeasurementTerms<N> terms_;
  std::unique_ptr<GraphSolver<N>> solver_;  // last: refers to the graph
};

extern template class WeightedGraph<3>;
extern template class WeightedGraph<6>;
extern template class WeightedGraph<7>;

/// Calls f with the problem as the WeightedGraph that it is.
template <typename F>
auto WithDimension(const GraphProblem& problem, const F& f) {
  return WithDimension(problem.graph().kind(),
                       [&](auto n) { return f(static_cast<const WeightedGraph<n>&>(problem)); });
}

}  // namespace tutti::internal
