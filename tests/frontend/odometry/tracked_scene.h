// A made-up scene as the parts of tracking see it: frames of random points, a map of one keyframe.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "frontend/odometry/tracked_frame.h"
#include "tests/frontend/map/point_scene.h"
#include "tutti/frontend/frame.h"

namespace tutti::testing {

/// T_world_camera of a camera that has moved and turned about the y axis.
inline Pose Moved(double x, double z, double yaw_rad = 0) { return Pose(ExpSO3({0, yaw_rad, 0}), {x, 0, z}); }

inline double Distance(const Pose& a, const Pose& b) { return LogSE3(a * b.Inverse()).norm(); }

class TrackedScene : protected PointScene {
 protected:
  /// Keyframe 0, at the origin, has a landmark for each of its features.
  TrackedScene() { MakeLandmarks(); }

  CameraRig Rig(Sensor sensor = Sensor::kMono) const {
    CameraRig rig;
    rig.sensor = sensor;
    rig.camera = camera_;
    rig.baseline_m = sensor == Sensor::kStereo ? 0.2 : 0;
    return rig;
  }

  /// What a camera at this place sees. With depth: of all features, to 0.1 %; else the sensor had measured
  /// none.
  TrackedFrame Frame(const Pose& T_world_camera, double stamp_s, bool depth = false) const {
    std::vector<int> order;
    const auto features = See(T_world_camera, &order);
    features->has_depth = true;
    for (std::size_t f = 0; depth && f < order.size(); ++f) {
      const Eigen::Vector3d p = T_world_camera.Inverse() * points_[static_cast<std::size_t>(order[f])];
      features->inverse_depth[f] = static_cast<float>(1 / p.z());
      features->inverse_depth_sigma[f] = 0.001F * features->inverse_depth[f];
    }
    const double index = std::isfinite(stamp_s) ? 10 * stamp_s : 0;  // a stamp may be NaN on purpose
    return {static_cast<std::int64_t>(index), stamp_s, features};
  }

  /// As many features as elsewhere, of things that nobody has seen.
  TrackedFrame Elsewhere(double stamp_s) const {
    TrackedFrame frame = Frame(Pose(), stamp_s);
    auto features = std::make_shared<FrameFeatures>(*frame.features);
    features->descriptors = features->descriptors.clone();
    cv::RNG(77).fill(features->descriptors, cv::RNG::UNIFORM, 0, 256);
    frame.features = features;
    return frame;
  }

  /// A covered lens.
  TrackedFrame Nothing(double stamp_s) const {
    auto features = std::make_shared<FrameFeatures>();
    features->has_depth = true;
    features->BuildGrid(camera_.width, camera_.height);
    return {0, stamp_s, features};
  }

  /// Keyframe 0 was the last frame, at 0 s.
  LastFrame AtFirstKeyframe() const {
    const Keyframe& k = map_.keyframe(0);
    LastFrame last;
    last.frame = {0, 0, k.features};
    last.matches = {k.features.get(), k.landmarks};
    last.reference = last.newest_keyframe = 0;
    return last;
  }
};

}  // namespace tutti::testing
