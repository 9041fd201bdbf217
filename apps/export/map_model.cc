#include "apps/export/map_model.h"

#include <algorithm>
#include <cstdio>
#include <map>

#include "apps/run/run_parts.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

// Landmarks that can be exported, by id; the number of observations is counted from 0.
std::map<int, ModelLandmark> FiniteLandmarks(const Map& map) {
  std::map<int, ModelLandmark> landmarks;
  for (const int id : map.LandmarkIds()) {
    if (!map.landmark(id).position.allFinite()) continue;
    ModelLandmark& out = landmarks[id];
    out.id = id;
    out.position = map.landmark(id).position;
  }
  return landmarks;
}

}  // namespace

MapModel ModelOf(const Odometry& odometry, const PoseGraph& graph, const FrameRange& frames) {
  const std::vector<int> pieces = FramePieces(odometry.map());
  if (pieces.empty()) throw InputError("the map is empty: no frame has a pose; there is nothing to export");
  MapModel model;
  model.camera = odometry.map().rig().camera;
  if (const std::optional<LensFound> lens = odometry.Report().lens; lens && !lens->steps.empty())
    model.lens = {lens->steps.back().k1, lens->steps.back().k2};
  model.graph = graph;
  model.trajectory =
      BodyTrajectory(FrameTrajectory(odometry.map(), pieces.front(), frames), odometry.map().rig());
  std::stable_sort(model.trajectory.begin(), model.trajectory.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.stamp_s < b.stamp_s; });
  std::map<int, ModelLandmark> landmarks = FiniteLandmarks(odometry.map());
  for (const int id : odometry.map().KeyframeIds()) {
    if (odometry.map().keyframe(id).piece != pieces.front()) {
      ++model.other_keyframes;
      continue;
    }
    const KeyframeView view = ViewOf(odometry.map(), id);
    if (!view.T_world_camera.IsFinite()) continue;
    const Pose T_camera_world = view.T_world_camera.Inverse();
    ModelKeyframe keyframe{id, view.frame_index, view.stamp_s, view.T_world_camera, {}};
    for (std::size_t f = 0; f < view.landmarks.size(); ++f) {
      const auto landmark = landmarks.find(view.landmarks[f]);
      if (landmark == landmarks.end()) continue;
      if (!((T_camera_world * landmark->second.position).z() > 0)) continue;
      keyframe.views.push_back({view.landmarks[f], view.keypoints[f].pt});
      ++landmark->second.observations;
    }
    model.keyframes.push_back(std::move(keyframe));
  }
  for (const auto& [id, landmark] : landmarks) {
    if (landmark.observations > 0) model.landmarks.push_back(landmark);
  }
  return model;
}

std::string ImageName(std::int64_t frame_index) {
  char name[48];
  std::snprintf(name, sizeof name, "frame_%06lld.png", static_cast<long long>(frame_index));
  return name;
}

}  // namespace tutti
