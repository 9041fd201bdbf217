// What a correction does to the map: keyframes move, and all that hangs on them.
#pragma once

#include <map>

#include "frontend/map/map.h"
#include "tutti/core/pose.h"

namespace tutti {

/// Moves keyframes to S_world_camera; the others stay. Each landmark goes along with the keyframe that made
/// it. The landmarks' geometry is not updated: Map::UpdateGeometry is to follow when all is in place.
void MoveKeyframes(const std::map<int, Similarity>& S_world_keyframe, Map* map);

/// Lets `map` have what an adjustment that turned `before` into `after` made of the landmarks: their places,
/// without the views that do not fit. Landmarks that changed since keep what they got, new ones stay.
void TakeAdjustedLandmarks(const Map& before, const Map& after, Map* map);

/// Keyframes of these pieces belong to another one from now on: piece -> the piece that it joined (which may
/// have joined a further one).
void JoinPieces(const std::map<int, int>& joined, Map* map);

}  // namespace tutti
