// Who is next to whom in a pose graph. Private to the back end.
#pragma once

#include <cstddef>
#include <vector>

#include "backend/graph/graph_structure.h"

namespace tutti::internal {

/// Edges of each node, and sets of nodes grown along them.
class Neighbourhood {
 public:
  /// `structure` outlives this object.
  explicit Neighbourhood(const GraphStructure& structure);

  /// Calls `visit(e)` for each edge of a node, in the order of the edges.
  template <typename Visit>
  void ForEdges(std::size_t node, Visit visit) const {
    for (std::size_t p = begin_[node]; p < begin_[node + 1]; ++p) visit(edges_[p]);
  }
  std::size_t Other(std::size_t e, std::size_t node) const {
    const EdgeEnds& ends = structure_.ends[e];
    return ends.from == node ? ends.to : ends.from;
  }

  /// Adds to `nodes` (and marks in `inside`) whatever is at most so many edges from the seeds. Does not go
  /// through nodes that are held.
  void Grow(const std::vector<std::size_t>& seeds, int hops, std::vector<std::size_t>& nodes,
            std::vector<bool>& inside) const;
  /// Nodes of a shortest path between two nodes, both ends included, that takes no edge of `without`; empty
  /// if there is none.
  std::vector<std::size_t> Path(std::size_t from, std::size_t to, const std::vector<bool>& without) const;

 private:
  const GraphStructure& structure_;
  std::vector<std::size_t> begin_, edges_;  // by node
};

}  // namespace tutti::internal
