// Where every frame was: what happens to the frames of a map when its keyframes change.
#pragma once

#include <map>

#include "tutti/core/pose.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// The newest `count` frames have drifted, evenly: by Exp(drift) until the frame that comes next, which has
/// this rotation (world to camera).
void SpreadDrift(int count, const Vector6d& drift, const Eigen::Quaterniond& R_camera_world, Map* map);

/// Keyframes are about to move: with their scale, so do the distances of their frames.
void RescaleFrames(const std::map<int, Similarity>& S_world_keyframe, Map* map);

/// Keyframes were removed: their frames hang on those that stand for them, and stay where they are.
void RehangFrames(const std::map<int, int>& into, Map* map);

}  // namespace tutti
