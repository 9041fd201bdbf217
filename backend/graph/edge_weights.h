// Scalar weights of the chordal cost. Private to the back end.
#pragma once

#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// kappa (rotation) and tau (translation) of an edge: SE-Sync's, Rosen et al., IJRR 2019, from the
/// information matrix.
struct ChordalWeights {
  double rotation = 1;
  double translation = 1;
};
ChordalWeights MakeChordalWeights(const PoseGraphEdge& edge, GraphKind kind);

/// EvaluateCosts at other poses: of the nodes, and behind them of the landmarks.
GraphCosts CostsAt(const PoseGraph& graph, const std::vector<Similarity>& poses);

}  // namespace tutti::internal
