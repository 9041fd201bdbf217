// What changed in a graph since the last look at it. Private to the back end.
#pragma once

#include <cstddef>
#include <limits>
#include <unordered_map>
#include <vector>

#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

struct GraphChanges {
  static constexpr std::size_t kNew = std::numeric_limits<std::size_t>::max();
  /// Parallel to edges(): where the very same edge was before, kNew for one that is new or differs.
  std::vector<std::size_t> edge_before;
  /// Positions of nodes that are new, have moved, are held or let go, or whose edges are not the same;
  /// ascending.
  std::vector<std::size_t> touched;
};

/// Remembers a graph, edge by edge and node by node.
class GraphMemory {
 public:
  /// Compares with what is remembered, and remembers `graph`. Time grows with the graph, but slowly: one look
  /// at each edge.
  GraphChanges Update(const PoseGraph& graph);
  /// The graph's poses after a solution, which are no change.
  void RememberPoses(const PoseGraph& graph) { nodes_ = graph.nodes(); }

 private:
  std::vector<std::size_t> MatchEdges(const PoseGraph& graph, std::vector<bool>& touched);
  void CompareNodes(const PoseGraph& graph, std::vector<bool>& touched) const;

  std::vector<PoseGraphNode> nodes_;
  std::vector<PoseGraphEdge> edges_;
};

}  // namespace tutti::internal
