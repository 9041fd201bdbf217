#include "frontend/map/fuse.h"

#include <algorithm>
#include <iterator>

#include "frontend/map/matcher.h"

namespace tutti {
namespace {
constexpr int kAround = 10;      // keyframes with most common landmarks, on both sides of a loop
constexpr int kMinShared = 15;   // landmarks in common with one of them
constexpr int kNeighbours = 12;  // of a keyframe that see the same
constexpr float kFusionError =
    2.4477F;  // of a landmark that is found again: 95 % [standard deviations of a corner]
constexpr float kLoopError = 5.0F;  // of a landmark that a loop projects [standard deviations of a corner]
}  // namespace

void FuseInto(int keyframe, const std::vector<std::pair<int, int>>& found, Map* map, int kept) {
  for (const auto& [landmark, feature] : found) {
    if (!map->landmark(landmark).alive) continue;
    const int present = map->keyframe(keyframe).landmarks[static_cast<std::size_t>(feature)];
    if (present == landmark) continue;
    if (present < 0) {
      map->AddObservation(landmark, keyframe, feature);
    } else {
      const bool more_views =
          map->landmark(present).observations.size() >= map->landmark(landmark).observations.size();
      const bool one_is_kept = (present < kept) != (landmark < kept);
      const bool keep_present = one_is_kept ? present < kept : more_views;
      map->ReplaceLandmark(keep_present ? landmark : present, keep_present ? present : landmark);
    }
  }
}

void FuseNeighbours(const PinholeCamera& camera, int id, Map* map, int kept) {
  const std::vector<int> neighbours = map->BestCovisible(id, kNeighbours, kMinShared);
  for (int other : neighbours) {
    const auto found =
        MatchForFusion(*map, camera, map->keyframe(other), map->LandmarksOf({id}), kFusionError);
    FuseInto(other, found, map, kept);
  }
  FuseInto(id, MatchForFusion(*map, camera, map->keyframe(id), map->LandmarksOf(neighbours), kFusionError),
           map, kept);
  for (int l : map->LandmarksOf({id})) map->UpdateLandmark(l);
}

void FuseAll(const PinholeCamera& camera, Map* map) {
  for (int id = 0; id < map->KeyframeCount(); ++id) {
    if (std::as_const(*map).keyframe(id).replaced_by < 0) FuseNeighbours(camera, id, map);
  }
}

int FuseLoop(const PinholeCamera& camera, int older, int newer, const Pose& T_older_newer, Map* map) {
  const auto around = [map](int id) {
    std::vector<int> side = map->BestCovisible(id, kAround, kMinShared);
    side.push_back(id);
    return side;
  };
  const std::vector<int> older_side = around(older), newer_side = around(newer);
  const std::vector<int> landmarks = map->LandmarksOf(older_side);
  const Pose T_world_newer = map->keyframe(older).T_world_camera * T_older_newer;
  const Pose T_loop_map = T_world_newer * map->keyframe(newer).T_world_camera.Inverse();
  for (int id : newer_side) {
    if (std::find(older_side.begin(), older_side.end(), id) != older_side.end()) continue;
    Keyframe seen = map->keyframe(id);
    seen.T_world_camera = T_loop_map * seen.T_world_camera;
    FuseInto(id, MatchForFusion(*map, camera, seen, landmarks, kLoopError), map);
  }
  const std::vector<int> a = map->LandmarksOf(older_side), b = map->LandmarksOf(newer_side);
  for (int id : b) map->UpdateLandmark(id);
  std::vector<int> common;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(common));
  return static_cast<int>(common.size());
}

}  // namespace tutti
