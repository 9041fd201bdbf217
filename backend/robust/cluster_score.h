// What a choice of loops costs if loops of one cluster do not err independently. Private to the back end.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "backend/robust/loop_clusters.h"
#include "backend/solver/graph_problem.h"

namespace tutti::internal {

/// How many loops of a cluster have weight 0.
template <int N>
std::size_t RejectedLoops(const GraphProblem<N>& problem, const LoopCluster& cluster) {
  return static_cast<std::size_t>(
      std::count_if(cluster.begin(), cluster.end(), [&](std::size_t e) { return problem.weight(e) == 0; }));
}

/// Chi-square of the odometry and of the loops of weight 1, the latter up to `threshold` each, and, for each
/// cluster of which m loops have weight 0, (1 + ln m) times `threshold`. Truncated least squares would take m
/// times it: enough to believe a false cluster of 50 that contradicts three true loops.
template <int N>
double ClusterScore(const GraphProblem<N>& problem, const std::vector<LoopCluster>& clusters,
                    double threshold) {
  double sum = 0;
  for (std::size_t e = 0; e < problem.weights().size(); ++e) {
    if (problem.weight(e) == 0) continue;
    sum += problem.IsLoop(e) ? std::min(problem.EdgeChi2(e), threshold) : problem.EdgeChi2(e);
  }
  for (const LoopCluster& cluster : clusters) {
    const std::size_t out = RejectedLoops(problem, cluster);
    if (out > 0) sum += threshold * (1 + std::log(static_cast<double>(out)));
  }
  return sum;
}

}  // namespace tutti::internal
