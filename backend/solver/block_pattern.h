// Which blocks of a graph's matrix are not zero. Private to the back end.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "backend/graph/graph_structure.h"

namespace tutti::internal {

/// One diagonal block for each unknown, one block below the diagonal for each pair of them that edges join.
struct BlockPattern {
  std::vector<int> unknown;  ///< parallel to nodes; -1: does not move
  int unknowns = 0;
  std::vector<std::pair<int, int>> pairs;  ///< of unknowns, the larger one first; ascending, each once
  std::vector<std::size_t> pair_of_edge;   ///< parallel to edges; 0 where an end does not move

  BlockPattern() = default;
  /// `constant` is parallel to the nodes, `counts` to the edges.
  BlockPattern(const std::vector<EdgeEnds>& ends, const std::vector<bool>& constant,
               const std::vector<bool>& counts)
      : unknown(NumberUnknowns(constant, unknowns)), pair_of_edge(ends.size(), 0) {
    std::vector<std::pair<std::pair<int, int>, std::size_t>> sorted;  // pair, edge
    for (std::size_t e = 0; e < ends.size(); ++e) {
      const int i = unknown[ends[e].from], j = unknown[ends[e].to];
      if (counts[e] && i >= 0 && j >= 0) sorted.push_back({{std::max(i, j), std::min(i, j)}, e});
    }
    std::sort(sorted.begin(), sorted.end());
    for (const auto& [pair, e] : sorted) {
      if (pairs.empty() || pairs.back() != pair) pairs.push_back(pair);
      pair_of_edge[e] = pairs.size() - 1;
    }
  }
};

}  // namespace tutti::internal
