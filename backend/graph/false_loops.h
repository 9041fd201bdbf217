// False loops on purpose: how robust is a back end?
//
// Three kinds, in equal parts where they stand alone: a random relative pose; the measurement of a true loop
// between two other nodes (a wrong place that looked the same); "the same place" with a small offset (as
// Suenderhauf and Protzel plant them, IROS 2012). Loops of one cluster lead from consecutive nodes to
// consecutive nodes and agree with each other through the graph's poses: two corridors that look alike.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

enum class FalseLoopKind { kInTurn, kAnywhere, kTrueMeasurement, kSamePlace };

struct FalseLoopOptions {
  int count = 100;       ///< false loops to plant
  int cluster_size = 1;  ///< loops that agree with each other; 1: each stands alone
  int min_gap = 20;      ///< nodes between the two ends, at least
  double min_error =
      0.05;  ///< off from the graph's poses by at least this share of their bounding box' diagonal
  FalseLoopKind kind = FalseLoopKind::kInTurn;
  int newest = -1;  ///< id of the node at which the later end lies; -1: anywhere
  std::uint64_t seed = 1;
  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

/// Adds loop edges that contradict the graph's poses, which should be its optimum, each within one of its
/// connected parts; returns their positions in edges(). They get the information of a true loop (the first
/// edge's where the graph has none). Throws InputError if the options are not usable or the graph is too
/// small. The same seed gives the same loops.
std::vector<std::size_t> PlantFalseLoops(PoseGraph& graph, const FalseLoopOptions& options);

/// Diagonal of the bounding box of the nodes' positions [m].
double BoundingBoxDiagonal(const PoseGraph& graph);

}  // namespace tutti
#pragma GCC visibility pop
