// Second thoughts about clusters of loops. Private to the back end.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "backend/robust/loop_agreement.h"
#include "backend/robust/robust_solver.h"
#include "backend/solver/graph_problem.h"

namespace tutti::internal {

/// How many loops of a cluster have weight 0.
std::size_t RejectedLoops(const GraphProblem& problem, const LoopCluster& cluster);

/// What a choice of loops costs if loops of one cluster do not err independently: chi-square of the odometry
/// and of the loops of weight 1, the latter up to `threshold` each, and, for each cluster of which m loops
/// have weight 0, (1 + ln m) times `threshold`. Truncated least squares would take m times it: enough to
/// believe a false cluster of 50 that contradicts three true loops.
double ClusterScore(const GraphProblem& problem, const std::vector<LoopCluster>& clusters, double threshold);

/// A start for robust losses: the clusters of loops that fit together. Begins with the odometry alone, at
/// poses that fulfil it, and takes in cluster after cluster, those first of which the graph is the most
/// certain where they should lie (EdgePrediction): there agreement is no chance. Each cluster that joins
/// makes the graph more certain of the next. So a cluster counts once, however many loops it has, and no
/// false one can bend the graph before its rivals have been heard. (Clusters that are tested one by one and
/// then together: RRR, Latif, Cadena, Neira, IJRR 2013. Loops that join if they fit what has joined before:
/// Olivastri and Pretto, IPC, ICRA 2024.)
///
/// Information matrices are often right up to a factor only. Hence the gate is narrow at first, a hundredth
/// of the threshold, and widens only when nothing is left that passes.
///
/// `clusters`: open loops only. `solve_once` runs so many iterations on the problem; false if they failed.
/// Leaves least squares with weights 0 or 1. False if the odometry does not hold the graph together, or a
/// solution failed. Loops that stand alone are no evidence for the others: they are weighed at the end, by
/// dynamic covariance scaling.
bool GrowClusters(GraphProblem& problem, const std::vector<LoopCluster>& clusters,
                  const std::function<bool(int)>& solve_once);

/// Where many false loops agree with each other, graduation may end in a local minimum, or in one that is
/// lower than the truth because 50 false loops weigh more than three true ones. So a solution that rejects
/// loops in a cluster gets a rival, from a start that does not depend on numbers (GrowClusters), and the one
/// of lower ClusterScore is kept. Solutions that reject single loops only are left alone. To be called after
/// RobustSolver::Refine. True if another solution is better; it is in the problem then, and the old one
/// otherwise.
bool SearchClusters(GraphProblem& problem, const PoseGraphOptions& options, RobustSolver& robust,
                    const std::function<bool(int)>& solve_once);

}  // namespace tutti::internal
