// Frames that are located in a map which stays as it is.
#pragma once

#include <cstdint>

#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

/// Says how the map explains a frame, and what the next one needs. What there is when Begin is called is the
/// map; keyframes and landmarks from then on are for the time being. Value type.
class Localizer {
 public:
  Localizer(const OdometryOptions& options, const CameraRig& rig)
      : options_(options), has_depth_(rig.sensor != Sensor::kMono), features_(options.features) {}

  void Begin(const Map& map);
  bool Begun() const { return keyframes_ >= 0; }

  /// A frame has a pose.
  void Found(const PoseFix& fix, const Map& map);
  /// A frame has none: the next one may be anywhere.
  void Lost();

  /// Features that the next frame needs, at most those of the options: where many landmarks agree, fewer
  /// features tell the pose as well.
  int features() const { return features_; }
  /// Whether a pose that fewer features tell should be looked for again with all of them.
  bool Doubts(const PoseFix& fix, std::int64_t frames_since_keyframe) const {
    return fix.by_grey || MustExtend(fix, frames_since_keyframe);
  }
  /// Whether the frame should become a keyframe for the time being, since map and keyframes so far show too
  /// little of what is in view. `frames_since_keyframe`: 1 for the frame after one.
  bool MustExtend(const PoseFix& fix, std::int64_t frames_since_keyframe) const;

  /// Keyframe of the map that shares most landmarks with the last frame that was found; -1: it is beyond the
  /// map.
  int keyframe() const { return keyframe_; }
  /// True if too few landmarks of the map agree with that frame: fewer than a lost one is found again by.
  bool Beyond() const { return beyond_; }

 private:
  OdometryOptions options_;
  bool has_depth_;
  int keyframes_ = -1, landmarks_ = 0;  // of the map
  int keyframe_ = -1;
  bool beyond_ = false;
  int features_;
};

}  // namespace tutti
