// Loops that agree with each other through the odometry between their ends, and so stand or fall together.
// Private to the back end.
#pragma once

#include <cstddef>
#include <vector>

#include "backend/graph/graph_structure.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// The cycle of two loops a, b and the odometry between their ends: query a -> query b, candidate b ->
/// candidate a. Maps the camera of candidate a onto itself; the identity where all agree (Mangelson, Dominic,
/// Eustice, Vasudevan, ICRA 2018, eq. 3). Each loop maps points of its query into its candidate.
template <typename Transform>
Transform LoopCycle(const Transform& a, const Transform& T_qa_qb, const Transform& b,
                    const Transform& T_cb_ca) {
  return a * T_qa_qb * (b.Inverse() * T_cb_ca);
}

/// One loop as its end `from` sees it.
struct MeasuredLoop {
  std::size_t edge = 0;          ///< position in edges()
  std::size_t from = 0, to = 0;  ///< places among the nodes by their ids (NodeOrder)
  Pose measurement;              ///< T_from_to; the scale of Sim(3) is left out
  Matrix6d covariance;           ///< as a perturbation of the frame of `to` [m^2, m rad, rad^2]

  /// This loop as its other end sees it.
  MeasuredLoop Reversed() const;
};

/// The loops of a graph and the odometry along its chain of nodes, both with their covariances.
class LoopAgreement {
 public:
  LoopAgreement(const PoseGraph& graph, const GraphStructure& structure, GraphObjective objective);

  const std::vector<MeasuredLoop>& loops() const { return loops_; }
  /// False: a node is missing from the chain of odometry edges between i and j.
  bool HasOdometry(std::size_t i, std::size_t j) const { return segment_[i] == segment_[j]; }
  /// Chi-square of the cycle loop a, odometry, loop b backwards, odometry (LoopCycle), to first order. Both
  /// pairs of ends must have odometry.
  double CycleChi2(const MeasuredLoop& a, const MeasuredLoop& b) const;

 private:
  void FollowOdometry(const PoseGraph& graph, const GraphStructure& structure, GraphObjective objective);
  Matrix6d Between(std::size_t i, std::size_t j, const Pose& T_target_world) const;

  GraphKind kind_;
  std::vector<std::size_t> place_;  // of the nodes; what follows is in this order
  std::vector<MeasuredLoop> loops_;
  std::vector<Pose> T_world_node_;
  std::vector<Matrix6d> covariance_;  // of the way from the chain's start, in world coordinates
  std::vector<int> segment_;          // nodes of different segments have no odometry between them
};

/// Positions in edges() of the loops of one cluster, by their earlier end.
using LoopCluster = std::vector<std::size_t>;

/// The loops of a graph in clusters: two loops whose ends are within a few nodes of each other, and that
/// agree through the odometry between (chi-square of the cycle <= `threshold`), are of one cluster, and so is
/// what they share neighbours with (single linkage). Such loops do not err independently: what deceived the
/// detector at one place deceives it one frame later, too (Latif, Cadena, Neira, IJRR 2013).
std::vector<LoopCluster> ClusterLoops(const PoseGraph& graph, const GraphStructure& structure,
                                      GraphObjective objective, double threshold);

}  // namespace tutti::internal
