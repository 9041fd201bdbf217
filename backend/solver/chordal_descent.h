// The chordal cost of a graph (pose_graph_optimizer.h). Private to the back end.
#pragma once

#include <vector>

#include "backend/graph/graph_structure.h"
#include "backend/solver/graph_problem.h"
#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

/// kappa (rotation) and tau (translation) of an edge: SE-Sync's, Rosen et al., IJRR 2019, from the
/// information matrix.
struct ChordalWeights {
  double rotation = 1;
  double translation = 1;
};
ChordalWeights MakeChordalWeights(const PoseGraphEdge& edge, GraphKind kind);

/// The cost at these poses, parallel to the nodes, all edges with weight 1.
double ChordalCost(const PoseGraph& graph, const std::vector<Similarity>& poses);

/// Moves `poses` (parallel to nodes, scale 1) to the minimum of
///   f = sum of kappa ||R_j - R_i R_ij||_F^2 + tau ||t_j - t_i - R_i t_ij||^2
/// that Newton's method leads to, all edges with weight 1; constant nodes stay. SE(2) and SE(3). Gauss-Newton
/// alone would creep where the residuals are large, and a certificate needs a point of next to no gradient.
/// The second derivative of a rotation's constraint is a block of the diagonal (the multipliers of
/// certificate.h), so that both Hessians have one pattern.
SolveSummary MinimiseChordal(const PoseGraph& graph, const GraphStructure& structure, int max_iterations,
                             double max_time_s, std::vector<Similarity>& poses, const StopRequest& stop = {});

}  // namespace tutti::internal
