// The three costs of a graph (pose_graph_optimizer.h) at its present poses.
#include <Eigen/LU>

#include "backend/graph/edge_error.h"
#include "backend/graph/edge_weights.h"
#include "backend/solver/measurement_terms.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace internal {

ChordalWeights MakeChordalWeights(const PoseGraphEdge& edge, GraphKind kind) {
  if (kind == GraphKind::kSE2) {
    const Eigen::Matrix2d tt = edge.information.topLeftCorner<2, 2>();
    return {edge.information(5, 5), 2.0 / tt.inverse().trace()};
  }
  const Eigen::Matrix3d tt = edge.information.topLeftCorner<3, 3>();
  const Eigen::Matrix3d rr = edge.information.block<3, 3>(3, 3);
  return {3.0 / (2.0 * rr.inverse().trace()), 3.0 / tt.inverse().trace()};
}

}  // namespace internal

namespace {

template <int N>
double Chi2(const PoseGraphEdge& edge, const Similarity& i, const Similarity& j, GraphObjective objective) {
  const auto constants = internal::MakeEdgeConstants<N>(edge, objective);
  double from[8], to[8];
  internal::PoseToBlock<N>(i, from);
  internal::PoseToBlock<N>(j, to);
  Eigen::Matrix<double, N, 1> error;
  internal::EdgeError<N>(constants, from, to, error, nullptr, nullptr);
  return (constants.sqrt_information * error).squaredNorm();
}

double Chi2(GraphKind kind, const PoseGraphEdge& edge, const Similarity& i, const Similarity& j,
            GraphObjective objective) {
  switch (kind) {
    case GraphKind::kSE2:
      return Chi2<3>(edge, i, j, objective);
    case GraphKind::kSE3:
      return Chi2<6>(edge, i, j, objective);
    case GraphKind::kSim3:
      return Chi2<7>(edge, i, j, objective);
  }
  return 0;
}

double Chordal(GraphKind kind, const PoseGraphEdge& edge, const Similarity& i, const Similarity& j) {
  const internal::ChordalWeights weights = internal::MakeChordalWeights(edge, kind);
  const Eigen::Matrix3d Ri = i.rotation.toRotationMatrix();
  const Eigen::Matrix3d difference =
      j.rotation.toRotationMatrix() - Ri * edge.measurement.rotation.toRotationMatrix();
  const Eigen::Vector3d step = j.translation - i.translation - i.scale * (Ri * edge.measurement.translation);
  return weights.rotation * difference.squaredNorm() + weights.translation * step.squaredNorm();
}

}  // namespace

namespace internal {

GraphCosts CostsAt(const PoseGraph& graph, const std::vector<Similarity>& poses) {
  GraphCosts costs;
  for (const PoseGraphEdge& edge : graph.edges()) {
    const Similarity &i = poses[graph.IndexOf(edge.from)], &j = poses[graph.IndexOf(edge.to)];
    costs.chi2 += Chi2(graph.kind(), edge, i, j, GraphObjective::kChi2);
    costs.chi2log += Chi2(graph.kind(), edge, i, j, GraphObjective::kChi2Log);
    costs.chordal += Chordal(graph.kind(), edge, i, j);
  }
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
