// PoseSearch for cameras in fast hands: with a rolling shutter, and through blur.
#pragma once

#include <optional>

#include "frontend/geometry/image_aligner.h"
#include "frontend/geometry/rolling_shutter.h"
#include "frontend/odometry/pose_search.h"

namespace tutti {

/// With a global shutter, PoseSearch. With a rolling one, features are straightened first by the motion so
/// far, and, once the frame is found, by the motion that its own rows tell: of a turning camera, they show it
/// better than the step from the last frame. In an image that is blurred, as far as the exposure is known,
/// landmarks are found at the ends of their streaks, or not at all: there, and where else none are found, the
/// grey values of the last frame tell where the camera went. Frames come with features as the image has
/// them; a fix has them straightened.
class RollingSearch {
 public:
  RollingSearch(const OdometryOptions& options, const CameraRig& rig)
      : options_(options), search_(options, rig), shutter_(rig), aligner_(rig) {}

  /// As PoseSearch::Find.
  std::optional<PoseFix> Find(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                              bool lost) const;
  /// As PoseSearch::FindAt.
  std::optional<PoseFix> FindAt(const Map& map, const TrackedFrame& frame, int keyframe) const;

 private:
  struct Expected {
    CameraMotion camera;
    MotionPrior prior;
    double depth = 0;        // of what is in view [m]
    double speed_rad_s = 0;  // of what is in view, as seen by the camera
    double exposure_s = 0;   // as far as it is known
  };
  std::optional<PoseFix> FindExpected(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                      const Expected& expected, bool lost) const;
  Expected Expect(const Map& map, const TrackedFrame& frame, const LastFrame& last) const;
  std::shared_ptr<const FrameFeatures> Straight(const TrackedFrame& frame, const Expected& expected) const;
  std::optional<CameraMotion> ByDepth(const TrackedFrame& frame, const LastFrame& last,
                                      const Expected& expected) const;
  std::optional<CameraMotion> Aligned(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                      const Expected& expected) const;
  std::optional<PoseFix> Blurred(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                 const Expected& expected) const;
  ImageAligner::Reference ReferenceOf(const Map& map, const LastFrame& last, double time_s) const;
  PoseFix FixByGrey(const TrackedFrame& frame, const LastFrame& last, const Expected& found) const;
  std::optional<ExposureEstimate::Misfits> MisfitsOf(const Map& map, const TrackedFrame& frame,
                                                     const LastFrame& last, const Expected& expected) const;
  std::optional<PoseFix> ByGreyValues(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                                      const Expected& expected) const;
  std::optional<PoseFix> Near(const Map& map, const TrackedFrame& frame, const LastFrame& last,
                              const Expected& expected) const;
  PoseFix Again(const Map& map, const FrameFeatures& seen, const Expected& expected, PoseFix fix) const;

  OdometryOptions options_;
  PoseSearch search_;
  RollingShutter shutter_;
  ImageAligner aligner_;
};

}  // namespace tutti
