// Optimises a graph again and again while it grows, at a cost that follows what changed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {

struct OnlineOptions {
  /// A node is left alone while the step that its own equations ask for is shorter than this many standard
  /// deviations of it, its neighbours held [1]. Smaller: closer to the optimum of the whole graph, slower.
  double settled_sigmas = 0.02;
  /// Beyond this share of the nodes all of them are solved for [1].
  double whole_fraction = 0.5;
  /// With PoseGraphSolver::kCeres, graphs of this many nodes and more are solved in parts as well, by
  /// kBlock: the whole of them would take Ceres longer than the time from one image to the next [nodes].
  std::uint64_t parts_from_nodes = 500;
  /// All of them, each time, by PoseGraphOptimizer.
  bool always_whole = false;
  std::string Validate() const;
};

struct OnlineReport {
  bool success = false;            ///< the poses are usable
  std::string reason;              ///< why not; empty on success
  bool whole = false;              ///< all nodes were solved for
  std::size_t nodes = 0;           ///< that were solved for
  int iterations = 0;              ///< of Levenberg-Marquardt, all parts together
  std::vector<EdgeOutcome> edges;  ///< parallel to PoseGraph::edges()
  double time_s = 0;               ///< wall time
};

/// Remembers the graph of the call before. What differs (new edges, new measurements, poses that were moved)
/// is where it starts; nodes around are solved for as far as the change reaches, the rest is held. Starts
/// from the poses in the graph. Deterministic: the same sequence of graphs gives the same bits.
///
/// Works this way with PoseGraphSolver::kBlock, and with kCeres from OnlineOptions::parts_from_nodes on, if
/// the initialisation is GraphInit::kFile and the loss one that is solved directly (kNone, kHuber) without
/// pairwise consistency and sigma test. In all other cases each call is one of PoseGraphOptimizer, and the
/// report says `whole`.
class OnlineOptimizer {
 public:
  /// Throws InputError if the options are not usable.
  explicit OnlineOptimizer(const PoseGraphOptions& options, const OnlineOptions& online = {});
  ~OnlineOptimizer();
  OnlineOptimizer(OnlineOptimizer&&) noexcept;
  OnlineOptimizer& operator=(OnlineOptimizer&&) noexcept;

  /// Moves the nodes of `graph` to the optimum. On failure it keeps its poses.
  OnlineReport Optimize(PoseGraph& graph);

  class Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace tutti
