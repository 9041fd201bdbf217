// The state of tracking: from frame to frame, against a map that others make.
#pragma once

#include <optional>

#include "frontend/odometry/keyframe_policy.h"
#include "frontend/odometry/rolling_search.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

/// Value type. Reads the map and never writes it: whoever changes the map tells it by FollowReference and
/// FollowLandmarks.
class Tracker {
 public:
  Tracker(const OdometryOptions& options, const CameraRig& rig)
      : search_(options, rig), policy_(options, rig), sensor_(rig.sensor) {}

  /// What became of a frame.
  struct Tracked {
    std::optional<PoseFix> fix;  ///< none: the frame is lost
    KeyframeNeed need = KeyframeNeed::kNone;
    int by_grey_before = 0;  ///< frames that grey values alone posed since the last fix on landmarks
  };

  TrackingState state() const { return state_; }
  const LastFrame& last() const { return last_; }

  /// The next frame, after Begin.
  Tracked Track(const TrackedFrame& frame, const Map& map);
  /// The next frame, whose pose is known from elsewhere.
  void Follow(const PoseFix& fix);
  /// Goes on from a fix at a keyframe, where the motion so far says nothing (Relocalizer).
  Tracked Relocalize(int keyframe, PoseFix fix, const Map& map);

  /// The frame is the keyframe that a piece of the map starts with.
  void Begin(const TrackedFrame& frame, const Keyframe& keyframe);
  /// The last frame's features as its motion shows them (RollingStart), which it goes on with.
  void Straighten(std::shared_ptr<const FrameFeatures> features, const Vector6d& motion);
  /// The last frame has become the newest keyframe.
  void BecomeKeyframe(const Keyframe& keyframe);
  /// The map is given up: kInitializing until Begin. The last frame stays, to start the next piece from, and
  /// for a short while its velocity, if it is in metres.
  void GiveUp();

  /// The next frame may be anywhere in the map: kLost until Relocalize.
  void Forget();

  /// The reference keyframe of the last frame has moved; the frame goes with it.
  void FollowReference(const Pose& T_world_old, const Similarity& S_world_new);
  /// Landmarks of the map were merged, removed, or added to the newest keyframe.
  void FollowLandmarks(const Map& map);

  template <class Archive>
  void State(Archive& archive) {
    archive(state_, last_);
  }
  /// Throws InputError if the state does not fit the map.
  void Check(const Map& map, const internal::SectionReader& file) const;

 private:
  Tracked Accept(PoseFix fix, const Map& map);
  bool GoesOn(const PoseFix& fix, const Map& map) const;
  void Move(const std::optional<Vector6d>& step, double dt);
  void Keep(const PoseFix& fix);

  RollingSearch search_;
  KeyframePolicy policy_;
  Sensor sensor_;
  TrackingState state_ = TrackingState::kInitializing;
  LastFrame last_;
};

}  // namespace tutti
