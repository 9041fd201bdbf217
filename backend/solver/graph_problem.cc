#include "backend/solver/graph_problem.h"

#include <algorithm>

#include "backend/solver/robust_loss.h"
#include "backend/solver/weighted_graph.h"

namespace tutti::internal {

GraphProblem::GraphProblem(const PoseGraph& graph, const GraphStructure& structure,
                           const PoseGraphOptions& options)
    : graph_(graph),
      structure_(structure),
      options_(options),
      threshold_(options.robust_chi2 > 0 ? options.robust_chi2 : ChiSquare99(dimension())),
      weights_(graph.edges().size(), 1.0) {}

double GraphProblem::Objective() const {
  double sum = 0;
  for (std::size_t e = 0; e < weights_.size(); ++e)
    sum += IsLoop(e) ? RobustCost(options_.robust, EdgeChi2(e), threshold_) : EdgeChi2(e);
  if (HasMeasurements()) sum += MeasurementChi2();
  return sum;
}

std::vector<bool> GraphProblem::Active() const {
  std::vector<bool> active(weights_.size());
  for (std::size_t e = 0; e < active.size(); ++e) active[e] = weights_[e] > 0;
  return active;
}

SolveSummary GraphProblem::Solve(int max_iterations, double max_time_s) {
  SolveSummary summary =
      Minimise({max_iterations, max_time_s, options_.function_tolerance, trust_region_, stop_});
  last_trust_region_ = summary.trust_region;
  trust_region_ = kInitialTrustRegion;
  return summary;
}

std::unique_ptr<GraphProblem> MakeGraphProblem(const PoseGraph& graph, const GraphStructure& structure,
                                               const PoseGraphOptions& options) {
  return WithDimension(graph.kind(), [&](auto n) -> std::unique_ptr<GraphProblem> {
    return std::make_unique<WeightedGraph<n>>(graph, structure, options);
  });
}

template <int N>
WeightedGraph<N>::WeightedGraph(const PoseGraph& graph, const GraphStructure& structure,
                                const PoseGraphOptions& options)
    : GraphProblem(graph, structure, options),
      blocks_(graph.nodes().size() * kBlock),
      terms_(graph, options.objective),
      solver_(HasMeasurements() || options.solver == PoseGraphSolver::kCeres ? MakeCeresSolver<N>()
                                                                             : MakeBlockSolver<N>()) {
  for (const PoseGraphEdge& edge : graph.edges()) edges_.emplace_back(edge, options.objective);
}

template <int N>
void WeightedGraph<N>::SetPoses(const std::vector<Similarity>& poses) {
  const std::size_t nodes = graph().nodes().size();
  for (std::size_t k = 0; k < nodes; ++k) PoseToBlock<N>(poses[k], Block(k));
  for (std::size_t k = nodes; k < poses.size(); ++k) terms_.SetLandmark(k - nodes, poses[k].translation);
}

template <int N>
std::vector<Similarity> WeightedGraph<N>::Poses() const {
  std::vector<Similarity> poses;
  poses.reserve(graph().nodes().size() + graph().landmarks().size());
  for (std::size_t k = 0; k < graph().nodes().size(); ++k) poses.push_back(BlockToPose<N>(Block(k)));
  for (std::size_t k = 0; k < graph().landmarks().size(); ++k)
    poses.emplace_back(1.0, Eigen::Quaterniond::Identity(), terms_.Landmark(k));
  return poses;
}

template <int N>
double WeightedGraph<N>::EdgeChi2(std::size_t e) const {
  const EdgeEnds& ends = structure().ends[e];
  Eigen::Matrix<double, N, 1> residual;
  edges_[e].EvaluateWhitened(Block(ends.from), Block(ends.to), residual, nullptr, nullptr);
  return residual.squaredNorm();
}

template <int N>
double WeightedGraph<N>::Loss(std::size_t e, double chi2, double& pull) const {
  pull = weight(e);
  if (loss() == nullptr || !IsLoop(e)) return pull * chi2;
  double rho[3];
  loss()->Evaluate(pull * chi2, rho);
  pull *= rho[1];
  return rho[0];
}

template <int N>
Eigen::SparseMatrix<double> WeightedGraph<N>::InformationMatrix(const std::vector<int>& unknown) const {
  std::vector<Eigen::Triplet<double>> triplets;
  for (std::size_t e = 0; e < edges_.size(); ++e) {
    if (weight(e) == 0) continue;
    const LinearizedEdge<N> edge = Linearized(e);
    const int at[2] = {unknown[structure().ends[e].from], unknown[structure().ends[e].to]};
    for (int a = 0; a < 2; ++a) {
      for (int b = 0; b < 2; ++b) {
        if (at[a] < 0 || at[b] < 0 || at[a] < at[b]) continue;
        const Eigen::Matrix<double, N, N> H = edge.jacobian[a].transpose() * edge.jacobian[b];
        for (int r = 0; r < N; ++r) {
          for (int c = 0; c < N; ++c) triplets.emplace_back(N * at[a] + r, N * at[b] + c, H(r, c));
        }
      }
    }
  }
  const auto moving = std::count_if(unknown.begin(), unknown.end(), [](int k) { return k >= 0; });
  Eigen::SparseMatrix<double> H(N * moving, N * moving);
  H.setFromTriplets(triplets.begin(), triplets.end());
  return H;
}

template class WeightedGraph<3>;
template class WeightedGraph<6>;
template class WeightedGraph<7>;

}  // namespace tutti::internal
