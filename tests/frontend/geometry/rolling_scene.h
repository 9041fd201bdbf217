// A made-up scene as a camera sees it that moves while it reads its rows.
#pragma once

#include <cmath>
#include <vector>

#include "frontend/dataset/rectified_rig.h"
#include "frontend/geometry/rolling_shutter.h"

namespace tutti::testing {

inline CameraRig RollingRig() {
  CameraRig rig;
  rig.sensor = Sensor::kRgbd;
  rig.camera = Pinhole(330, 330, 199.5, 150, {400, 301});
  rig.readout_s = 0.03;
  return rig;
}

/// What a moving camera sees of points: the pixel in whose row a point is when that row is read.
struct RollingScene {
  CameraRig rig = RollingRig();
  RollingShutter shutter{rig};
  Pose T_camera_world{ExpSO3({0.1, -0.2, 0.05}), {0.2, 0.1, -0.1}};
  Vector6d motion;
  std::vector<Eigen::Vector3d> points;  ///< in the world
  std::vector<PointObservation> seen;   ///< as the image has them

  explicit RollingScene(double depth_sigma) {
    motion << 0.5, -0.3, 0.2, 1.5, -2.5, 3.0;
    for (int i = 0; i < 150; ++i) {
      const Eigen::Vector3d p(1.6 * std::sin(1.3 * i), 1.2 * std::sin(2.1 * i + 1), 2.5 + std::sin(0.7 * i));
      Eigen::Vector2d pixel = rig.camera.Project(p);
      Eigen::Vector3d then = p;
      for (int k = 0; k < 20; ++k) {
        then = ExpSE3(motion * shutter.TimeOf(pixel.y())) * p;
        pixel = rig.camera.Project(then);
      }
      if (!rig.camera.Contains(pixel)) continue;
      points.push_back(T_camera_world.Inverse() * p);
      seen.push_back({points.back(), pixel, 1, 1 / then.z(), depth_sigma});
    }
  }

  /// What is seen as features, with their depths.
  FrameFeatures Features() const {
    FrameFeatures features;
    for (const PointObservation& o : seen) {
      features.keypoints.emplace_back(static_cast<float>(o.pixel.x()), static_cast<float>(o.pixel.y()),
                                      31.0F);
      features.inverse_depth.push_back(static_cast<float>(o.inverse_depth));
    }
    return features;
  }
};

}  // namespace tutti::testing
