// A model whose numbers can be worked out by hand.
#pragma once

#include <cmath>

#include "apps/export/map_model.h"
#include "frontend/dataset/rectified_rig.h"

namespace tutti::testing {

/// Two keyframes, frames 4 and 10: the first in the origin, looking along the world's z; the second in (1, 2,
/// 3), looking along the world's x, its y the world's. Landmarks: 7 in (5, 2, 3), four metres before the
/// second; 9 in (2, 1, 4), seen by both; 12 in (0, 0, 8), seen by the first alone. All views are exact.
inline MapModel TwoCameras() {
  MapModel model;
  model.camera = Pinhole(500, 400, 300, 200, {640, 480});
  const double half = std::sqrt(0.5);
  model.keyframes = {{0, 4, 0.4, Pose(), {}},
                     {3, 10, 1.0, Pose(Eigen::Quaterniond(half, 0, half, 0), Eigen::Vector3d(1, 2, 3)), {}}};
  // In the second camera's frame, 7 is in (0, 0, 4) and 9 in (-1, -1, 1).
  model.keyframes[0].views = {{9, {550, 300}}, {12, {300, 200}}, {7, {300 + 2500.0F / 3, 200 + 800.0F / 3}}};
  model.keyframes[1].views = {{7, {300, 200}}, {9, {-200, -200}}};
  model.landmarks = {{7, {5, 2, 3}, 2, {{255, 10, 20}}},
                     {9, {2, 1, 4}, 2, {{0, 200, 100}}},
                     {12, {0, 0, 8}, 1, {{128, 128, 128}}}};
  for (const ModelKeyframe& keyframe : model.keyframes) {
    model.graph.AddNode(keyframe.id, keyframe.T_world_camera);
    model.trajectory.push_back({keyframe.stamp_s, keyframe.T_world_camera});
  }
  model.graph.AddOdometry(0, 3, Similarity(model.keyframes[1].T_world_camera), Matrix7d::Identity());
  return model;
}

}  // namespace tutti::testing
