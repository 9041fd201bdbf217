// False loops on purpose (run.inject_false_loops).
#include <algorithm>
#include <vector>

#include "apps/run/slam_run.h"
#include "apps/slam/loop_constraint.h"
#include "backend/graph/false_loops.h"
#include "core/numbers.h"
#include "tutti/core/error.h"

namespace tutti {

// False if the map is too small yet.
bool PlantedLoops::Plant(int newest, SlamSystem* slam) {
  if (left_ == 0) return false;
  PoseGraph graph = slam->Graph();
  FalseLoopOptions options;
  const bool two = made_ % 3 == 2;
  options.kind = made_ % 3 == 0 ? FalseLoopKind::kAnywhere : FalseLoopKind::kSamePlace;
  options.count = options.cluster_size = two ? std::min(2, left_) : 1;
  options.min_error = 0.25;
  options.newest = newest;
  options.seed = seed_ + static_cast<std::uint64_t>(made_);
  std::vector<std::size_t> planted;
  try {
    planted = PlantFalseLoops(graph, options);
  } catch (const InputError&) {
    return false;
  }
  for (const std::size_t e : planted) {
    const PoseGraphEdge& edge = graph.edges()[e];
    const bool forward = edge.from < edge.to;
    const int candidate = forward ? edge.from : edge.to;
    const double seen = MedianDepth(ViewOf(slam->odometry()->map(), candidate));
    const double depth = seen > 0 ? seen : 1;  // without landmarks AddLoop refuses it
    slam->AddLoop(
        candidate, forward ? edge.to : edge.from, forward ? edge.measurement : edge.measurement.Inverse(),
        MakeInformation(kLoopSigmaFraction * depth, kLoopSigmaDeg * internal::kRadians, kLoopSigmaScale));
  }
  left_ -= static_cast<int>(planted.size());
  ++made_;
  return true;
}

void PlantedLoops::OnKeyframe(int keyframe, SlamSystem* slam) {
  constexpr int kEveryKeyframes = 3;
  if (++keyframes_ % kEveryKeyframes == 0) Plant(keyframe, slam);
}

void PlantedLoops::PlantRest(SlamSystem* slam) {
  while (Plant(-1, slam)) slam->Finish();
}

}  // namespace tutti
