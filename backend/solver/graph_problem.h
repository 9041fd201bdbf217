// What is to be minimised for a pose graph, with weights that GNC changes. Private to the back end.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "backend/solver/graph_solver.h"
#include "backend/solver/linearized_edge.h"
#include "backend/solver/robust_loss.h"

namespace tutti::internal {

template <int N>
class GraphProblem {
 public:
  GraphProblem(const PoseGraph& graph, const GraphStructure& structure, const PoseGraphOptions& options)
      : graph_(graph),
        options_(options),
        threshold_(options.robust_chi2 > 0 ? options.robust_chi2 : ChiSquare99(N)) {
    weighted_.structure = &structure;
    weighted_.blocks.resize(graph.nodes().size() * WeightedGraph<N>::kBlock);
    weighted_.weights.assign(graph.edges().size(), 1.0);
    for (const PoseGraphEdge& edge : graph.edges()) {
      weighted_.constants.push_back(MakeEdgeConstants<N>(edge, options.objective));
      weighted_.is_loop.push_back(edge.kind == EdgeKind::kLoop);
    }
    weighted_.terms = std::make_unique<MeasurementTerms<N>>(graph, options.objective);
    solver_ = MakeGraphSolver<N>(HasMeasurements() ? PoseGraphSolver::kCeres : options.solver);
  }

  /// Chi-square beyond which a loop is doubted.
  double threshold() const { return threshold_; }
  void SetThreshold(double threshold) { threshold_ = threshold; }

  /// Of the nodes, and behind them of the landmarks, which are where they were if they are left out.
  void SetPoses(const std::vector<Similarity>& poses) {
    const std::size_t nodes = graph_.nodes().size();
    for (std::size_t k = 0; k < nodes; ++k) PoseToBlock<N>(poses[k], weighted_.Block(k));
    for (std::size_t k = nodes; k < poses.size(); ++k)
      weighted_.terms->SetLandmark(k - nodes, poses[k].translation);
  }
  std::vector<Similarity> Poses() const {
    std::vector<Similarity> poses;
    poses.reserve(graph_.nodes().size() + weighted_.terms->Landmarks());
    for (std::size_t k = 0; k < graph_.nodes().size(); ++k)
      poses.push_back(BlockToPose<N>(weighted_.Block(k)));
    for (std::size_t k = 0; k < weighted_.terms->Landmarks(); ++k)
      poses.emplace_back(1.0, Eigen::Quaterniond::Identity(), weighted_.terms->Landmark(k));
    return poses;
  }
  /// Landmarks' or priors.
  bool HasMeasurements() const { return !weighted_.terms->Empty(); }

  /// e^T Omega e of one edge, weight not applied.
  double EdgeChi2(std::size_t e) const { return weighted_.Chi2(e); }
  bool IsLoop(std::size_t e) const { return weighted_.is_loop[e]; }
  LinearizedEdge<N> Linearized(std::size_t e) const {
    const EdgeEnds& ends = structure().ends[e];
    return Linearize<N>(weighted_.constants[e], weighted_.Block(ends.from), weighted_.Block(ends.to));
  }
  const GraphStructure& structure() const { return *weighted_.structure; }

  /// What the options ask to minimise (no 1/2), at the present poses.
  double Objective() const {
    double sum = 0;
    for (std::size_t e = 0; e < weighted_.weights.size(); ++e)
      sum += IsLoop(e) ? RobustCost(options_.robust, EdgeChi2(e), threshold_) : EdgeChi2(e);
    if (HasMeasurements()) sum += weighted_.terms->Chi2(weighted_.blocks.data());
    return sum;
  }

  /// The loss on loop edges from now on; nullptr: least squares.
  void SetLoss(ceres::LossFunction* owned) { weighted_.loss.reset(owned); }

  double weight(std::size_t e) const { return weighted_.weights[e]; }
  const std::vector<double>& weights() const { return weighted_.weights; }
  void SetWeight(std::size_t e, double weight) { weighted_.weights[e] = weight; }

  /// The next solution goes on with the trust region that the last one ended with, instead of a wide one. For
  /// rounds of few iterations, which would spend them all on narrowing it.
  void KeepTrustRegion() { trust_region_ = std::min(last_trust_region_, kInitialTrustRegion); }

  /// Solve() asks it before each iteration, and throws Stopped.
  void SetStop(StopRequest stop) { stop_ = std::move(stop); }

  SolveSummary Solve(int max_iterations, double max_time_s) {
    SolveSummary summary = solver_->Solve(
        weighted_, {max_iterations, max_time_s, options_.function_tolerance, trust_region_, stop_});
    last_trust_region_ = summary.trust_region;
    trust_region_ = kInitialTrustRegion;
    return summary;
  }

 private:
  const PoseGraph& graph_;
  const PoseGraphOptions& options_;
  double threshold_;
  StopRequest stop_;
  double trust_region_ = kInitialTrustRegion, last_trust_region_ = kInitialTrustRegion;
  WeightedGraph<N> weighted_;
  std::unique_ptr<GraphSolver<N>> solver_;  // last: refers to the graph
};

}  // namespace tutti::internal
