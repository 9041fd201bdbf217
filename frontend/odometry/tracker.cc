#include "frontend/odometry/tracker.h"

#include <cmath>
#include <set>
#include <utility>

#include "frontend/odometry/reach.h"

namespace tutti {
namespace {
constexpr double kMeanTime = 0.3;    // time constant of the mean velocity [s]
constexpr double kLongestGap = 1.0;  // two poses that are further apart tell no velocity [s]
}  // namespace

Tracker::Tracked Tracker::Track(const TrackedFrame& frame, const Map& map) {
  std::optional<PoseFix> fix = search_.Find(map, frame, last_, state_ == TrackingState::kLost);
  if (fix) return Accept(*std::move(fix), map);
  state_ = TrackingState::kLost;
  return {};
}

Tracker::Tracked Tracker::Relocalize(int keyframe, PoseFix fix, const Map& map) {
  state_ = TrackingState::kLost;  // no velocity between there and here
  last_.newest_keyframe = keyframe;
  return Accept(std::move(fix), map);
}

// True if it is within reach of the motion so far.
bool Tracker::GoesOn(const PoseFix& fix, const Map& map) const {
  if (!last_.velocity) return false;
  const auto reach = ReachOf(last_, fix.frame.Time(), map.MedianDepth(last_.reference), sensor_);
  return reach && reach->Has(fix.T_camera_world);
}

// The frame has this pose: it may become a keyframe, and is what the next one starts from.
Tracker::Tracked Tracker::Accept(PoseFix fix, const Map& map) {
  const KeyframeNeed need = policy_.Need(map, fix, last_);
  const double dt = fix.frame.Time() - last_.frame.Time();
  const bool moves = state_ == TrackingState::kTracking && dt > 0 && dt < kLongestGap;
  last_.steady = moves && GoesOn(fix, map);
  // What grey values had drifted by before is no motion.
  const Pose seen = fix.drift ? ExpSE3(*fix.drift).Inverse() * fix.T_camera_world : fix.T_camera_world;
  const Vector6d motion = LogSE3(seen * last_.T_camera_world.Inverse());
  Move(moves ? std::optional<Vector6d>(motion / dt) : std::nullopt, dt);
  if (fix.motion) last_.velocity = fix.motion;
  if (fix.misfits) last_.exposure.Add(*fix.misfits);
  Keep(fix);
  const int by_grey_before = fix.by_grey ? 0 : last_.by_grey;
  last_.by_grey = fix.by_grey ? last_.by_grey + 1 : 0;
  return {std::move(fix), need, by_grey_before};
}

// The mean motion from the last frame to this one; none: it is not known.
void Tracker::Move(const std::optional<Vector6d>& step, double dt) {
  const std::optional<Vector6d> before = last_.step;
  last_.velocity = last_.step = step;
  if (step && last_.mean_velocity) {
    *last_.mean_velocity += (1 - std::exp(-dt / kMeanTime)) * (*step - *last_.mean_velocity);
  } else {
    last_.mean_velocity = step;
  }
  last_.motion = step.value_or(Vector6d::Zero());
  last_.change = Vector6d::Zero();
  if (!step || !before) return;
  last_.change = (*step - *before) / dt;
  last_.motion += 0.5 * (*step - *before);
}

void Tracker::Follow(const PoseFix& fix) {
  Move(std::nullopt, 0);
  last_.steady = false;
  Keep(fix);
}

// As what the next frame starts from.
void Tracker::Keep(const PoseFix& fix) {
  last_.frame = fix.frame;
  last_.matches = fix.matches;
  last_.T_camera_world = fix.T_camera_world;
  last_.reference = fix.reference;
  ++last_.frames_since_keyframe;
  state_ = TrackingState::kTracking;
}

void Tracker::Begin(const TrackedFrame& frame, const Keyframe& keyframe) {
  // That the camera goes on as it did is likelier than that it has stopped: what stands still before it in
  // the first frame may be a lorry that drives along. Another map of one camera has another unit.
  const double lost_s = frame.Time() - last_.frame.Time();
  if (sensor_ == Sensor::kMono || !(lost_s >= 0 && lost_s <= kVelocityHolds)) last_.velocity.reset();
  const std::optional<Vector6d> velocity = last_.velocity;
  Move(std::nullopt, 0);
  last_.velocity = velocity;
  last_.frame = frame;
  last_.matches.features = frame.features.get();
  last_.T_camera_world = keyframe.T_world_camera.Inverse();
  last_.steady = false;
  state_ = TrackingState::kTracking;
  BecomeKeyframe(keyframe);
}

void Tracker::Straighten(std::shared_ptr<const FrameFeatures> features, const Vector6d& motion) {
  last_.frame.features = std::move(features);
  last_.matches.features = last_.frame.features.get();
  last_.velocity = motion;
}

void Tracker::BecomeKeyframe(const Keyframe& keyframe) {
  last_.matches.landmarks = keyframe.landmarks;
  last_.reference = last_.newest_keyframe = keyframe.id;
  last_.frames_since_keyframe = 0;
}

void Tracker::GiveUp() { state_ = TrackingState::kInitializing; }

void Tracker::Forget() {
  last_ = LastFrame();
  state_ = TrackingState::kLost;
}

void Tracker::FollowReference(const Pose& T_world_old, const Similarity& S_world_new) {
  Pose T_reference_camera = T_world_old.Inverse() * last_.T_camera_world.Inverse();
  T_reference_camera.translation *= S_world_new.scale;
  last_.T_camera_world = (S_world_new.RigidPart() * T_reference_camera).Inverse();
  for (std::optional<Vector6d>* motion : {&last_.velocity, &last_.step, &last_.mean_velocity}) {
    if (*motion) (*motion)->head<3>() *= S_world_new.scale;
  }
  last_.motion.head<3>() *= S_world_new.scale;
  last_.change.head<3>() *= S_world_new.scale;
}

void Tracker::FollowLandmarks(const Map& map) {
  std::set<int> taken;  // merged landmarks were two in the last frame
  for (int& l : last_.matches.landmarks) {
    l = map.Present(l);
    if (l >= 0 && !taken.insert(l).second) l = -1;
  }
  if (last_.frames_since_keyframe == 0)
    last_.matches.landmarks = map.keyframe(last_.newest_keyframe).landmarks;
}

}  // namespace tutti
