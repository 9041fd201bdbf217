#include "backend/robust/loop_clusters.h"

#include <algorithm>
#include <numeric>

#include "backend/robust/loop_agreement.h"

namespace tutti::internal {
namespace {

/// Both ends of two loops of a cluster are within so many nodes of each other.
constexpr std::size_t kClusterReach = 10;

std::size_t RootOf(std::vector<std::size_t>& parent, std::size_t k) {
  while (parent[k] != k) k = parent[k] = parent[parent[k]];
  return k;
}

}  // namespace

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
