// Connected parts of a graph, what holds each in place, and which nodes follow each other. Private to the
// back end.
#pragma once

#include <cstddef>
#include <type_traits>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// Node positions of an edge's two ends, looked up once.
struct EdgeEnds {
  std::size_t from = 0, to = 0;
};

struct GraphStructure {
  std::vector<EdgeEnds> ends;              ///< parallel to edges()
  std::vector<bool> constant;              ///< parallel to nodes(): fixed nodes and the anchors of the others
  std::vector<std::size_t> component_of;   ///< parallel to nodes()
  std::vector<std::size_t> anchor;         ///< node position, per component
  std::vector<GraphComponent> components;  ///< in the order of each one's first node
};

/// Landmarks connect the nodes that see them.
GraphStructure AnalyseGraph(const PoseGraph& graph);

/// The structure without the anchors of parts that priors or fixed landmarks hold.
GraphStructure HeldByPriors(GraphStructure structure, const PoseGraph& graph);

/// Position of each node among those that move; -1: held in place.
std::vector<int> NumberUnknowns(const std::vector<bool>& constant, int& count);

/// Nodes by their ids, which are all that a file says about their order.
struct NodeOrder {
  std::vector<std::size_t> place;  ///< of each node, parallel to nodes(): 0 for the smallest id
  std::vector<std::size_t> robot;  ///< the same: nodes of one robot have one number
};

NodeOrder OrderOf(const PoseGraph& graph);

/// The representative of k in a forest of parents (union-find); shortens the way to it.
std::size_t RootOf(std::vector<std::size_t>& parent, std::size_t k);

/// Calls f(n) with the number of a node's coordinates as a constant: `n` converts to 3, 6 or 7 in a
/// template's argument.
template <typename F>
auto WithDimension(GraphKind kind, const F& f) {
  if (kind == GraphKind::kSE2) return f(std::integral_constant<int, 3>());
  if (kind == GraphKind::kSE3) return f(std::integral_constant<int, 6>());
  return f(std::integral_constant<int, 7>());
}

}  // namespace tutti::internal
