// Which nodes follow each other? Private to the back end.
#pragma once

#include <cstddef>
#include <vector>

#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

/// Nodes by their ids, which are all that a file says about their order.
struct NodeOrder {
  std::vector<std::size_t> place;  ///< of each node, parallel to nodes(): 0 for the smallest id
  std::vector<std::size_t> robot;  ///< the same: nodes of one robot have one number
};

NodeOrder OrderOf(const PoseGraph& graph);

}  // namespace tutti::internal
