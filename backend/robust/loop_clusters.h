// Loops that stand or fall together. Private to the back end.
#pragma once

#include <cstddef>
#include <vector>

#include "backend/graph/graph_structure.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// Positions in edges() of the loops of one cluster, by their earlier end.
using LoopCluster = std::vector<std::size_t>;

/// The loops of a graph in clusters: two loops whose ends are within a few nodes of each other, and that
/// agree through the odometry between (chi-square of the cycle <= `threshold`), are of one cluster, and so is
/// what they share neighbours with (single linkage). Such loops do not err independently: what deceived the
/// detector at one place deceives it one frame later, too (Latif, Cadena, Neira, IJRR 2013).
std::vector<LoopCluster> ClusterLoops(const PoseGraph& graph, const GraphStructure& structure,
                                      GraphObjective objective, double threshold);

}  // namespace tutti::internal
