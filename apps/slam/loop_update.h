// What closed loops ask of the odometry's map.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "tutti/backend/keyframe_graph.h"
#include "tutti/frontend/odometry.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// How the map changes, in the order of the fields.
struct MapCorrection {
  std::map<int, Similarity> S_world_keyframe;          ///< keyframes that move; empty: none does
  std::map<int, int> merges;                           ///< map piece -> the piece that it joined
  std::shared_ptr<const GlobalAdjustment> adjustment;  ///< landmarks are where it found them, if there is one
  std::vector<LoopEdge> fused;  ///< what both ends of these loops see becomes one, where they say it is
};

/// What LoopCloser wants done; empty: nothing.
struct LoopUpdate {
  std::optional<MapCorrection> correction;
  std::vector<std::size_t> revoked;  ///< records of loops that the detector is to forget
};

/// Changes the map. Returns how many landmarks the two ends of each fused loop have in common then.
std::vector<int> Apply(const MapCorrection& correction, Odometry* odometry);

}  // namespace tutti
#pragma GCC visibility pop
