// The first frame of a map piece, of a camera that reads its rows one after the other.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "frontend/geometry/rolling_shutter.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/map.h"

namespace tutti {

/// With depth, one frame makes a map, and is taken as if the camera had been at rest. The next frame tells
/// how it moved. From the first frame's rows and the next one's, only the change of the motion can be seen;
/// the step between the two is the mean of both motions. Immutable.
class RollingStart {
 public:
  explicit RollingStart(const CameraRig& rig) : shutter_(rig), depth_(rig.sensor != Sensor::kMono) {}

  /// True if the last frame made a map and was taken to be at rest.
  bool Is(const LastFrame& last) const;
  /// The first frame's motion, of T_camera_world, per second; `assumed` while the next one was found. None:
  /// the next frame says nothing of it.
  static std::optional<Vector6d> MotionOf(const LastFrame& first, const PoseFix& next,
                                          const Vector6d& assumed);
  /// Straightens that frame's keyframe, and its landmarks with it. `seen`: its features as the image has
  /// them. Returns them straightened.
  std::shared_ptr<const FrameFeatures> Straighten(const FrameFeatures& seen, const Vector6d& motion,
                                                  int keyframe, Map* map) const;

 private:
  RollingShutter shutter_;
  bool depth_;
};

/// One camera has no pose in its first frames, but how it turns there bends them by more than it moves. Its
/// turn from one of these frames to the next, by what both see: the mean motion between them, of
/// T_camera_world, per second. None: they are too far apart in time, or have too little in common.
std::optional<Vector6d> TurnBetween(const PinholeCamera& camera, const TrackedFrame& before,
                                    const TrackedFrame& after);
/// How it turns in `frame`, if it goes on changing its turn as in `before` (frames as their images have them,
/// oldest first; the last two count).
std::optional<Vector6d> TurnIn(const PinholeCamera& camera, const std::vector<TrackedFrame>& before,
                               const TrackedFrame& frame);

}  // namespace tutti
