#include "frontend/map/move_keyframes.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "frontend/map/map_frames.h"

namespace tutti {

void MoveKeyframes(const std::map<int, Similarity>& S_world_keyframe, Map* map) {
  RescaleFrames(S_world_keyframe, map);
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

std::vector<AdjustedLandmark> AdjustedLandmarks(const Map& before, const Map& after) {
  std::vector<AdjustedLandmark> all;
  for (int id = 0; id < after.LandmarkCount(); ++id) {
    const Landmark &old = before.landmark(id), &now = after.landmark(id);
    if (!old.alive) continue;
    AdjustedLandmark adjusted;
    adjusted.id = id;
    adjusted.removed = !now.alive;
    if (now.alive && now.position != old.position) adjusted.position = now.position;
    for (const Observation& o : old.observations) {
      const bool stays = adjusted.removed ||
                         std::any_of(now.observations.begin(), now.observations.end(),
                                     [&](const Observation& other) { return other.keyframe == o.keyframe; });
      if (!stays) adjusted.without.push_back(o.keyframe);
    }
    if (adjusted.removed || adjusted.position || !adjusted.without.empty())
      all.push_back(std::move(adjusted));
  }
  return all;
}

void TakeAdjustedLandmarks(const std::vector<AdjustedLandmark>& all, Map* map) {
  for (const AdjustedLandmark& adjusted : all) {
    if (!std::as_const(*map).landmark(adjusted.id).alive) continue;
    if (adjusted.removed) map->RemoveLandmark(adjusted.id);
    if (adjusted.position) map->landmark(adjusted.id).position = *adjusted.position;
    for (const int keyframe : adjusted.without) map->RemoveObservation(adjusted.id, keyframe);
  }
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
