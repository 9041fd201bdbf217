// When a tracked frame becomes a keyframe: by what the map still has to show.
#pragma once

#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

/// Why a frame becomes a keyframe; the first one that holds.
enum class KeyframeNeed {
  kNone,       ///< it does not
  kThin,       ///< one camera: the next frame would see so few landmarks that it may be lost
  kVeryWeak,   ///< tracking would soon be lost, or lives on grey values alone
  kFewNear,    ///< stereo and depth: few landmarks are near enough to hold the camera's place
  kWeak,       ///< fewer landmarks than OdometryOptions::keyframe_inlier_ratio are left
  kUncovered,  ///< stereo and depth: too much of the image has no landmark
  kInterval    ///< the last keyframe was long ago, and the camera moved since
};

class KeyframePolicy {
 public:
  KeyframePolicy(const OdometryOptions& options, const CameraRig& rig) : options_(options), rig_(rig) {}

  /// `fix`: of the frame in question; `before`: the last frame that had a pose. Stereo and depth: a frame
  /// that came without its depth or right image is none, for its landmarks would have no measured distance.
  KeyframeNeed Need(const Map& map, const PoseFix& fix, const LastFrame& before) const;

 private:
  int Established(const Map& map, int keyframe) const;

  OdometryOptions options_;
  CameraRig rig_;
};

}  // namespace tutti
