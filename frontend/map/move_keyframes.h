// What a correction does to the map: keyframes move, and all that hangs on them.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// Moves keyframes to S_world_camera; the others stay. Each landmark goes along with the keyframe that made
/// it, and each frame with its own. The landmarks' geometry is not updated: Map::UpdateGeometry is to follow
/// when all is in place.
void MoveKeyframes(const std::map<int, Similarity>& S_world_keyframe, Map* map);

/// What an adjustment made of a landmark.
struct AdjustedLandmark {
  int id = -1;
  bool removed = false;
  std::optional<Eigen::Vector3d> position;  ///< none: it stays where it is
  std::vector<int> without;                 ///< keyframes whose views did not fit, if it is not removed

  template <class Archive>
  void State(Archive& archive) {
    archive(id, removed, position, without);
  }
};

/// The landmarks of which an adjustment that turned `before` into `after` made something else, ascending.
std::vector<AdjustedLandmark> AdjustedLandmarks(const Map& before, const Map& after);

/// Lets `map` have them: their places, without the views that do not fit. Landmarks that are gone since stay
/// so, new ones stay.
void TakeAdjustedLandmarks(const std::vector<AdjustedLandmark>& adjusted, Map* map);

/// Keyframes of these pieces belong to another one from now on: piece -> the piece that it joined (which may
/// have joined a further one).
void JoinPieces(const std::map<int, int>& joined, Map* map);

}  // namespace tutti
