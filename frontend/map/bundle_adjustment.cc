#include "frontend/map/bundle_adjustment.h"

#include <algorithm>
#include <map>

#include "frontend/map/measured.h"
#include "frontend/map/window_solver.h"

namespace tutti {
namespace {

Window MakeWindow(const Map& map, const std::vector<int>& moving, const std::vector<int>& fixed,
                  const std::vector<int>& landmarks, const BundleAdjustmentOptions& options) {
  Window window;
  window.moving = static_cast<int>(moving.size());
  window.lens = options.lens;
  std::map<int, int> cameras;
  for (const std::vector<int>* set : {&moving, &fixed}) {
    for (int id : *set) {
      if (!cameras.emplace(id, static_cast<int>(window.T_camera_world.size())).second) continue;
      window.T_camera_world.push_back(map.keyframe(id).T_world_camera.Inverse());
    }
  }
  window.first_observation.push_back(0);
  for (int id : landmarks) {
    const Landmark& l = map.landmark(id);
    const bool stays = id < options.kept_landmarks;
    window.points.push_back(l.position);
    if (stays) ++window.fixed_points;
    for (const Observation& o : l.observations) {
      const auto camera = cameras.find(o.keyframe);
      if (camera == cameras.end() || (stays && camera->second >= window.moving)) continue;
      if (options.only_aligned && map.Doubtful(o, id)) continue;
      window.observations.push_back(
          {camera->second, Measured(map, *map.keyframe(o.keyframe).features, o, id, options.pixel_sigma)});
    }
    window.first_observation.push_back(window.observations.size());
  }
  return window;
}

// Removes the window's observations that do not fit; returns how many.
int RemoveMisfits(const PinholeCamera& camera, const std::vector<int>& moving, const std::vector<int>& fixed,
                  const std::vector<int>& landmarks, const BundleAdjustmentOptions& options,
                  const LensError& lens, Map* map) {
  std::map<int, Pose> T_camera_world;
  for (const std::vector<int>* set : {&moving, &fixed}) {
    for (int id : *set) T_camera_world[id] = map->keyframe(id).T_world_camera.Inverse();
  }
  std::vector<std::pair<int, int>> misfits;  // landmark, keyframe
  for (int id : landmarks) {
    const Landmark& l = map->landmark(id);
    for (const Observation& o : l.observations) {
      if (o.keyframe < options.kept_keyframes) continue;
      const auto pose = T_camera_world.find(o.keyframe);
      if (pose == T_camera_world.end()) continue;
      PointObservation m = Measured(*map, *map->keyframe(o.keyframe).features, o, id, options.pixel_sigma);
      m.pixel = LensError::Correct(camera, lens.value, m.pixel);
      Eigen::Vector3d r;
      if (!ReprojectionResidual(camera, pose->second, m, &r, nullptr) || r.squaredNorm() > ChiSquareBound(m))
        misfits.emplace_back(id, o.keyframe);
    }
  }
  for (const auto& [landmark, keyframe] : misfits) map->RemoveObservation(landmark, keyframe);
  return static_cast<int>(misfits.size());
}

// Landmarks that are left with one view and no depth go; what the others look like is worked out again.
void Refresh(const std::vector<int>& landmarks, Map* map) {
  for (int id : landmarks) {
    const Landmark& l = map->landmark(id);
    if (!l.alive) continue;
    const bool has_depth =
        std::any_of(l.observations.begin(), l.observations.end(), [&](const Observation& o) {
          return map->keyframe(o.keyframe).features->inverse_depth[static_cast<std::size_t>(o.feature)] > 0;
        });
    if (l.observations.size() < 2 && !has_depth) {
      map->RemoveLandmark(id);
    } else {
      map->UpdateLandmark(id);
    }
  }
}

// Another camera's keyframes do not have this one's error: a window with both says nothing of it.
bool OfOneCamera(const Map& map, const std::vector<int>& moving, const std::vector<int>& fixed) {
  const auto other = [&map](int id) { return map.keyframe(id).features->other_camera; };
  return std::none_of(moving.begin(), moving.end(), other) && std::none_of(fixed.begin(), fixed.end(), other);
}

}  // namespace

BundleAdjustmentReport AdjustWindow(const PinholeCamera& camera, const std::vector<int>& moving,
                                    const std::vector<int>& fixed, const BundleAdjustmentOptions& given,
                                    Map* map) {
  BundleAdjustmentOptions options = given;
  if (!OfOneCamera(*map, moving, fixed)) {
    options.lens = {};
    options.observe_lens = false;
  }
  const std::vector<int> landmarks = map->LandmarksOf(moving);
  BundleAdjustmentReport report;
  report.keyframes = static_cast<int>(moving.size());
  report.fixed = static_cast<int>(fixed.size());
  report.landmarks = static_cast<int>(landmarks.size());
  if (landmarks.empty() || moving.empty()) return report;
  Window window = MakeWindow(*map, moving, fixed, landmarks, options);
  const WindowReport solved = SolveWindow(camera, options.iterations, &window, options.stop);
  report.observations = static_cast<int>(window.observations.size());
  report.initial_cost = solved.initial_cost;
  report.final_cost = solved.final_cost;
  report.usable = solved.usable;
  if (!report.usable) return report;
  if (options.observe_lens) report.lens_seen = ObserveLens(camera, window);
  for (std::size_t i = 0; i < moving.size(); ++i)
    map->keyframe(moving[i]).T_world_camera = window.T_camera_world[i].Inverse();
  for (std::size_t i = window.fixed_points; i < landmarks.size(); ++i)
    map->landmark(landmarks[i]).position = window.points[i];
  report.removed = RemoveMisfits(camera, moving, fixed, landmarks, options, window.lens, map);
  Refresh(landmarks, map);
  return report;
}

BundleAdjustmentReport AdjustLocally(const PinholeCamera& camera, int keyframe,
                                     const BundleAdjustmentOptions& options, Map* map) {
  std::vector<int> moving = map->BestCovisible(keyframe, options.keyframes - 1, 15);
  moving.push_back(keyframe);
  std::sort(moving.begin(), moving.end());
  moving.erase(moving.begin(), std::lower_bound(moving.begin(), moving.end(), options.kept_keyframes));
  std::map<int, int> votes;  // keyframes outside the window -> common landmarks
  for (int id : moving) {
    for (int l : map->keyframe(id).landmarks) {
      if (l < 0) continue;
      for (const Observation& o : map->landmark(l).observations) {
        if (!std::binary_search(moving.begin(), moving.end(), o.keyframe)) ++votes[o.keyframe];
      }
    }
  }
  std::vector<std::pair<int, int>> order;
  order.reserve(votes.size());
  for (const auto& [id, count] : votes) order.emplace_back(-count, id);
  std::sort(order.begin(), order.end());
  std::vector<int> fixed;
  for (const auto& [count, id] : order) {
    if (static_cast<int>(fixed.size()) >= options.fixed_keyframes) break;
    fixed.push_back(id);
  }
  // Without outside help the oldest keyframes of the window fix the gauge: one pose, and for mono the scale
  // by a second.
  const std::size_t needed = options.metric ? 1 : 2;
  while (fixed.size() < needed && moving.size() > 1) {
    fixed.push_back(moving.front());
    moving.erase(moving.begin());
  }
  std::sort(fixed.begin(), fixed.end());
  return AdjustWindow(camera, moving, fixed, options, map);
}

}  // namespace tutti
