// Where landmarks and priors are when a solution starts. Private to the back end.
#pragma once

#include <vector>

#include "backend/graph/graph_structure.h"
#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

/// Behind the poses of the nodes those of the landmarks (without rotation): where their measurements see them
/// from there, on average; where they are in the graph if they have bearings only, are fixed, or, with
/// `as_given`, have an estimate.
void AppendLandmarks(const PoseGraph& graph, bool as_given, std::vector<Similarity>& poses);

/// Moves each part of the graph that priors hold, as a whole, to where its priors want it.
void AlignToPriors(const PoseGraph& graph, const GraphStructure& structure, std::vector<Similarity>& poses);

}  // namespace tutti::internal
