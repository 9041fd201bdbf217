// Connected parts of a graph and what holds each in place. Private to the back end.
#pragma once

#include <cstddef>
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

/// The same, but parts that priors or fixed landmarks hold are not held by an anchor as well.
GraphStructure HeldByPriors(GraphStructure structure, const PoseGraph& graph);

}  // namespace tutti::internal
