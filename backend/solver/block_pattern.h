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
  std::vector<int> unknown;                ///< parallel to nodes; -1: does not move
  std::vector<std::pair<int, int>> pairs;  ///< of unknowns, the larger one first; ascending, each once
  std::vector<std::size_t> pair_of_edge;   ///< parallel to the edges that count; 0 where an end does not move
  int unknowns = 0;

  /// Of the nodes and edges at these positions.
  BlockPattern(const std::vector<EdgeEnds>& ends, const std::vector<std::size_t>& edges,
               const std::vector<std::size_t>& nodes, std::size_t all_nodes)
      : unknown(all_nodes, -1), pair_of_edge(edges.size(), 0) {
    for (const std::size_t node : nodes) unknown[node] = unknowns++;
    std::vector<std::pair<std::pair<int, int>, std::size_t>> sorted;  // pair, place in edges
    for (std::size_t p = 0; p < edges.size(); ++p) {
      const int i = unknown[ends[edges[p]].from], j = unknown[ends[edges[p]].to];
      if (i >= 0 && j >= 0) sorted.push_back({{std::max(i, j), std::min(i, j)}, p});
    }
    std::sort(sorted.begin(), sorted.end());
    for (const auto& [pair, p] : sorted) {
      if (pairs.empty() || pairs.back() != pair) pairs.push_back(pair);
      pair_of_edge[p] = pairs.size() - 1;
    }
  }
  BlockPattern() = default;

  /// Of all edges, and of the nodes that are not held in place.
  static BlockPattern OfMovingNodes(const GraphStructure& structure) {
    std::vector<std::size_t> edges(structure.ends.size()), nodes;
    for (std::size_t e = 0; e < edges.size(); ++e) edges[e] = e;
    for (std::size_t k = 0; k < structure.constant.size(); ++k) {
      if (!structure.constant[k]) nodes.push_back(k);
    }
    return {structure.ends, edges, nodes, structure.constant.size()};
  }
};

}  // namespace tutti::internal
