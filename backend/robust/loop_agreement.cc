#include "backend/robust/loop_agreement.h"

#include <algorithm>
#include <numeric>

#include "backend/solver/graph_initialization.h"
#include "backend/uncertainty/edge_covariance.h"

namespace tutti::internal {
namespace {

/// Both ends of two loops of a cluster are within so many nodes of each other.
constexpr std::size_t kClusterReach = 10;

}  // namespace

MeasuredLoop MeasuredLoop::Reversed() const {
  return {edge, to, from, measurement.Inverse(), Transported(covariance, measurement)};
}

LoopAgreement::LoopAgreement(const PoseGraph& graph, const GraphStructure& structure,
                             GraphObjective objective)
    : kind_(graph.kind()) {
  place_ = OrderOf(graph).place;
  FollowOdometry(graph, structure, objective);
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const PoseGraphEdge& edge = graph.edges()[e];
    if (edge.kind != EdgeKind::kLoop) continue;
    loops_.push_back({e, place_[structure.ends[e].from], place_[structure.ends[e].to],
                      edge.measurement.RigidPart(), EdgeCovariance(edge, graph.kind(), objective)});
  }
}

void LoopAgreement::FollowOdometry(const PoseGraph& graph, const GraphStructure& structure,
                                   GraphObjective objective) {
  const std::size_t n = graph.nodes().size();
  const std::vector<Similarity> poses = OdometryInitialization(graph, structure);
  T_world_node_.resize(n);
  for (std::size_t k = 0; k < n; ++k) T_world_node_[place_[k]] = poses[k].RigidPart();
  covariance_.assign(n, Matrix6d::Zero());
  segment_.assign(n, 0);
  std::vector<const PoseGraphEdge*> step(n, nullptr);  // from the node before
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    if (graph.edges()[e].kind == EdgeKind::kLoop) continue;
    const auto [low, high] = std::minmax(place_[structure.ends[e].from], place_[structure.ends[e].to]);
    if (high == low + 1) step[high] = &graph.edges()[e];
  }
  for (std::size_t k = 1; k < n; ++k) {
    segment_[k] = segment_[k - 1] + (step[k] == nullptr ? 1 : 0);
    if (step[k] == nullptr) continue;
    const std::size_t to = place_[graph.IndexOf(step[k]->to)];
    covariance_[k] = covariance_[k - 1] +
                     Transported(EdgeCovariance(*step[k], graph.kind(), objective), T_world_node_[to]);
  }
}

Matrix6d LoopAgreement::Between(std::size_t i, std::size_t j, const Pose& T_target_world) const {
  const Matrix6d way = i < j ? covariance_[j] - covariance_[i] : covariance_[i] - covariance_[j];
  return Transported(way, T_target_world);
}

double LoopAgreement::CycleChi2(const MeasuredLoop& a, const MeasuredLoop& b) const {
  const auto& T = T_world_node_;
  const Pose back = T[b.from].Inverse() * T[a.from];
  const Pose rest = b.measurement.Inverse() * back;
  const Pose E = LoopCycle(a.measurement, T[a.to].Inverse() * T[b.to], b.measurement, back);
  const Matrix6d covariance = Transported(a.covariance, (T[a.to].Inverse() * T[b.to] * rest).Inverse()) +
                              Transported(b.covariance, rest.Inverse()) +
                              Between(a.to, b.to, rest.Inverse() * T[b.to].Inverse()) +
                              Between(b.from, a.from, T[a.from].Inverse());
  return Mahalanobis(LogSE3(E), covariance, kind_);
}

std::vector<LoopCluster> ClusterLoops(const PoseGraph& graph, const GraphStructure& structure,
                                      GraphObjective objective, double threshold) {
  const LoopAgreement agreement(graph, structure, objective);
  std::vector<MeasuredLoop> loops;
  for (const MeasuredLoop& loop : agreement.loops())
    loops.push_back(loop.from < loop.to ? loop : loop.Reversed());
  std::stable_sort(loops.begin(), loops.end(),
                   [](const MeasuredLoop& a, const MeasuredLoop& b) { return a.from < b.from; });
  std::vector<std::size_t> parent(loops.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  for (std::size_t a = 0; a < loops.size(); ++a) {
    for (std::size_t b = a + 1; b < loops.size() && loops[b].from <= loops[a].from + kClusterReach; ++b) {
      const auto [low, high] = std::minmax(loops[a].to, loops[b].to);
      if (high > low + kClusterReach || RootOf(parent, a) == RootOf(parent, b)) continue;
      if (!agreement.HasOdometry(loops[a].from, loops[b].from) ||
          !agreement.HasOdometry(loops[a].to, loops[b].to))
        continue;
      if (agreement.CycleChi2(loops[a], loops[b]) <= threshold) parent[RootOf(parent, b)] = RootOf(parent, a);
    }
  }
  std::vector<LoopCluster> clusters;
  std::vector<std::size_t> cluster_of(loops.size(), loops.size());
  for (std::size_t k = 0; k < loops.size(); ++k) {
    std::size_t& cluster = cluster_of[RootOf(parent, k)];
    if (cluster == loops.size()) {
      cluster = clusters.size();
      clusters.emplace_back();
    }
    clusters[cluster].push_back(loops[k].edge);
  }
  return clusters;
}

}  // namespace tutti::internal
