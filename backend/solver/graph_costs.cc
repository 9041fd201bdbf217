// The three costs of a graph (pose_graph_optimizer.h) at its present poses.
#include "backend/graph/edge_error.h"
#include "backend/solver/chordal_descent.h"
#include "backend/solver/graph_problem.h"
#include "backend/solver/measurement_terms.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

double Chi2(GraphKind kind, const PoseGraphEdge& edge, const Similarity& i, const Similarity& j,
            GraphObjective objective) {
  return internal::WithDimension(kind, [&](auto n) {
    const internal::EdgeError<n> error_of(edge, objective);
    double from[8], to[8];
    internal::PoseToBlock<n>(i, from);
    internal::PoseToBlock<n>(j, to);
    Eigen::Matrix<double, n, 1> error;
    error_of.Evaluate(from, to, error, nullptr, nullptr);
    return (error_of.sqrt_information * error).squaredNorm();
  });
}

}  // namespace

namespace internal {

GraphCosts CostsAt(const PoseGraph& graph, const std::vector<Similarity>& poses) {
  GraphCosts costs;
  for (const PoseGraphEdge& edge : graph.edges()) {
    const Similarity &i = poses[graph.IndexOf(edge.from)], &j = poses[graph.IndexOf(edge.to)];
    costs.chi2 += Chi2(graph.kind(), edge, i, j, GraphObjective::kChi2);
    costs.chi2log += Chi2(graph.kind(), edge, i, j, GraphObjective::kChi2Log);
  }
  costs.chordal = ChordalCost(graph, poses);
  if (graph.measurements().empty()) return costs;
  costs.chi2 += MeasurementChi2(graph, GraphObjective::kChi2, poses);
  costs.chi2log += MeasurementChi2(graph, GraphObjective::kChi2Log, poses);
  return costs;
}

}  // namespace internal

double EdgeChi2(const PoseGraph& graph, const PoseGraphEdge& edge, GraphObjective objective) {
  return Chi2(graph.kind(), edge, graph.Node(edge.from).pose, graph.Node(edge.to).pose, objective);
}

GraphCosts EvaluateCosts(const PoseGraph& graph) {
  std::vector<Similarity> poses;
  poses.reserve(graph.nodes().size() + graph.landmarks().size());
  for (const PoseGraphNode& node : graph.nodes()) poses.push_back(node.pose);
  for (const PoseGraphLandmark& landmark : graph.landmarks())
    poses.emplace_back(1.0, Eigen::Quaterniond::Identity(), landmark.position);
  return internal::CostsAt(graph, poses);
}

}  // namespace tutti
