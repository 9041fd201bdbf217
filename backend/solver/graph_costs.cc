// The three costs of a graph (pose_graph_optimizer.h) at its present poses.
#include <Eigen/LU>

#include "backend/graph/edge_error.h"
#include "backend/graph/edge_weights.h"
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
double Chi2(const PoseGraph& graph, const PoseGraphEdge& edge, GraphObjective objective) {
  const auto constants = internal::MakeEdgeConstants<N>(edge, objective);
  double from[8], to[8];
  internal::PoseToBlock<N>(graph.Node(edge.from).pose, from);
  internal::PoseToBlock<N>(graph.Node(edge.to).pose, to);
  Eigen::Matrix<double, N, 1> error;
  internal::EdgeError<N>(constants, from, to, error, nullptr, nullptr);
  return (constants.sqrt_information * error).squaredNorm();
}

double Chordal(const PoseGraph& graph, const PoseGraphEdge& edge) {
  const Similarity& i = graph.Node(edge.from).pose;
  const Similarity& j = graph.Node(edge.to).pose;
  const internal::ChordalWeights weights = internal::MakeChordalWeights(edge, graph.kind());
  const Eigen::Matrix3d Ri = i.rotation.toRotationMatrix();
  const Eigen::Matrix3d difference =
      j.rotation.toRotationMatrix() - Ri * edge.measurement.rotation.toRotationMatrix();
  const Eigen::Vector3d step = j.translation - i.translation - i.scale * (Ri * edge.measurement.translation);
  return weights.rotation * difference.squaredNorm() + weights.translation * step.squaredNorm();
}

}  // namespace

double EdgeChi2(const PoseGraph& graph, const PoseGraphEdge& edge, GraphObjective objective) {
  switch (graph.kind()) {
    case GraphKind::kSE2:
      return Chi2<3>(graph, edge, objective);
    case GraphKind::kSE3:
      return Chi2<6>(graph, edge, objective);
    case GraphKind::kSim3:
      return Chi2<7>(graph, edge, objective);
  }
  return 0;
}

GraphCosts EvaluateCosts(const PoseGraph& graph) {
  GraphCosts costs;
  for (const PoseGraphEdge& edge : graph.edges()) {
    costs.chi2 += EdgeChi2(graph, edge, GraphObjective::kChi2);
    costs.chi2log += EdgeChi2(graph, edge, GraphObjective::kChi2Log);
    costs.chordal += Chordal(graph, edge);
  }
  return costs;
}

}  // namespace tutti
