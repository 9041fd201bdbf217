// Landmarks that are one: found again in keyframes that have another landmark there, or none.
#pragma once

#include <utility>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/frontend/map.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// Lets `keyframe` see the landmarks at the features of `found` (landmark, feature). Where it sees another
/// one there, the two are merged into the one with more views; a landmark with an id below `kept` wins
/// against one that has none.
void FuseInto(int keyframe, const std::vector<std::pair<int, int>>& found, Map* map, int kept = 0);

/// What a keyframe and those with most landmarks in common with it see is looked for in each other, and
/// fused.
void FuseNeighbours(const PinholeCamera& camera, int keyframe, Map* map, int kept = 0);

/// What keyframes see of the same landmarks without having found it yet is looked for, all over the map, and
/// landmarks that are one become one.
void FuseAll(const PinholeCamera& camera, Map* map);

/// After a loop: what the keyframes around `older` see is looked for in those around `newer`, and fused.
/// `T_older_newer`: as the loop says, which is more precise than the map. Returns how many landmarks the two
/// sides have in common then.
int FuseLoop(const PinholeCamera& camera, int older, int newer, const Pose& T_older_newer, Map* map);

}  // namespace tutti
#pragma GCC visibility pop
