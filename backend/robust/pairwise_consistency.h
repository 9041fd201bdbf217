// Pairwise consistency maximisation. Private to the back end.
#pragma once

#include <vector>

#include "backend/graph/graph_structure.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// The cycle of two loops a, b and the odometry between their ends: query a -> query b, candidate b ->
/// candidate a. Maps the camera of candidate a onto itself; the identity where all agree (Mangelson et al.,
/// eq. 3). Each loop maps points of its query into its candidate.
template <typename Transform>
Transform LoopCycle(const Transform& a, const Transform& T_qa_qb, const Transform& b,
                    const Transform& T_cb_ca) {
  return a * T_qa_qb * (b.Inverse() * T_cb_ca);
}

/// The largest set of loops that agree pair by pair (Mangelson, Dominic, Eustice, Vasudevan, ICRA 2018): the
/// cycle loop a, odometry, loop b backwards, odometry closes within `threshold` [chi-square], the odometry's
/// and the loops' covariances propagated to first order. Greedy clique; true: in it. Parallel to edges(),
/// true for odometry edges. Pairs without a chain of odometry edges between their ends are taken to agree;
/// the scale of Sim(3) is left out. Time and memory grow with the square of the number of loops.
std::vector<bool> PairwiseConsistentEdges(const PoseGraph& graph, const GraphStructure& structure,
                                          GraphObjective objective, double threshold);

}  // namespace tutti::internal
#pragma GCC visibility pop
