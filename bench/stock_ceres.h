// The yardstick: a pose graph solved as Ceres' own example pose_graph_3d does it (automatic derivatives,
// defaults of Levenberg-Marquardt, sparse Cholesky, one thread, from the poses of the graph).
#pragma once

#include "tutti/backend/pose_graph.h"

namespace tutti {

/// Moves the nodes of an SE(3) graph; the first node stays. Returns the final cost, with the factor 1/2.
double SolveWithStockCeres(PoseGraph& graph);

}  // namespace tutti
