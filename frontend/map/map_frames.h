// Where every frame was: what happens to the frames of a map when its keyframes change.
#pragma once

#include <map>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/frontend/map.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// The newest `count` frames have drifted, evenly: by Exp(drift) until the frame that comes next, which has
/// this rotation (world to camera).
void SpreadDrift(int count, const Vector6d& drift, const Eigen::Quaterniond& R_camera_world, Map* map);

/// T_world_camera of all frames. Where the keyframe that they hang on changes, they follow both, the nearer
/// one (in time) more, and the keyframes' own frames theirs alone: no correction leaves a step.
std::vector<Pose> FramePoses(const Map& map);

/// Keyframes are about to move: with their scale, so do the distances of their frames.
void RescaleFrames(const std::map<int, Similarity>& S_world_keyframe, Map* map);

/// Keyframes were removed: their frames hang on those that stand for them, and have the `poses` of before
/// (FramePoses).
void RehangFrames(const std::vector<Pose>& poses, Map* map);

}  // namespace tutti
#pragma GCC visibility pop
