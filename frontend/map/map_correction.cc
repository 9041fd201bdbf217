#include "frontend/map/map_correction.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace tutti {
namespace {

void TakeAdjusted(int id, const Landmark& before, const Landmark& after, Map* map) {
  if (!before.alive || !std::as_const(*map).landmark(id).alive) return;
  if (!after.alive) {
    map->RemoveLandmark(id);
    return;
  }
  if (after.position != before.position) map->landmark(id).position = after.position;
  for (const Observation& o : before.observations) {
    const bool stays = std::any_of(after.observations.begin(), after.observations.end(),
                                   [&](const Observation& other) { return other.keyframe == o.keyframe; });
    if (!stays) map->RemoveObservation(id, o.keyframe);
  }
}

}  // namespace

void MoveKeyframes(const std::map<int, Similarity>& S_world_keyframe, Map* map) {
  const Map& now = *map;
  std::vector<Pose> old_T_camera_world;
  std::vector<Similarity> corrected;
  for (int id = 0; id < now.KeyframeCount(); ++id) {
    const Pose& T_world_camera = now.keyframe(id).T_world_camera;
    old_T_camera_world.push_back(T_world_camera.Inverse());
    const auto it = S_world_keyframe.find(id);
    corrected.push_back(it != S_world_keyframe.end() ? it->second : Similarity(T_world_camera));
  }
  for (int l = 0; l < now.LandmarkCount(); ++l) {
    if (!now.landmark(l).alive) continue;
    Landmark& landmark = map->landmark(l);
    const std::size_t r = static_cast<std::size_t>(landmark.reference);
    landmark.position = corrected[r] * (old_T_camera_world[r] * landmark.position);
  }
  for (std::size_t k = 0; k < corrected.size(); ++k)
    map->keyframe(static_cast<int>(k)).T_world_camera = corrected[k].RigidPart();
}

void TakeAdjustedLandmarks(const Map& before, const Map& after, Map* map) {
  for (int l = 0; l < after.LandmarkCount(); ++l) TakeAdjusted(l, before.landmark(l), after.landmark(l), map);
}

void JoinPieces(const std::map<int, int>& joined, Map* map) {
  for (int id = 0; id < map->KeyframeCount(); ++id) {
    const int now = std::as_const(*map).keyframe(id).piece;
    int piece = now;
    // So many steps at most: pieces that join in a circle are a mistake, and not to hang for it.
    for (std::size_t step = 0; step < joined.size() && joined.count(piece) != 0; ++step)
      piece = joined.at(piece);
    if (piece != now) map->keyframe(id).piece = piece;
  }
}

}  // namespace tutti
