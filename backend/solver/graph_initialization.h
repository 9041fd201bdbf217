// Where the optimiser starts from. Private to the back end.
#pragma once

#include <string>
#include <vector>

#include "backend/graph/graph_structure.h"
#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

/// Poses along a spanning tree of each component, breadth first from its constant nodes, odometry edges
/// before loops.
std::vector<Similarity> OdometryInitialization(const PoseGraph& graph, const GraphStructure& structure);

/// Chordal relaxation: rotations by linear least squares over 3x3 (2x2) matrices, projected to SO(d), then
/// scales and translations by linear least squares (Carlone, Tron, Daniilidis, Dellaert, ICRA 2015; Martinec
/// & Pajdla, CVPR 2007). Constant nodes keep their poses. Empty if a linear system can't be solved; `reason`
/// then says why.
std::vector<Similarity> ChordalInitialization(const PoseGraph& graph, const GraphStructure& structure,
                                              std::string& reason);

/// Behind the poses of the nodes those of the landmarks (without rotation): where their measurements see them
/// from there, on average; where they are in the graph if they have bearings only, are fixed, or, with
/// `as_given`, have an estimate.
void AppendLandmarks(const PoseGraph& graph, bool as_given, std::vector<Similarity>& poses);

/// Moves each part of the graph that priors hold, as a whole, to where its priors want it.
void AlignToPriors(const PoseGraph& graph, const GraphStructure& structure, std::vector<Similarity>& poses);

}  // namespace tutti::internal
