// The first pose of a map piece, and the frames before it.
#include <algorithm>

#include "frontend/odometry/odometry_impl.h"
#include "frontend/odometry/stage_times.h"

namespace tutti {
namespace {
constexpr int kMinDepthFeatures = 50;  // features with depth that a metric map starts from
}

TrackResult Odometry::Impl::Initialize(const TrackedFrame& frame) {
  const ScopedStopwatch watch(&stages, Lane::kTracking, "initialize");
  TrackResult result;
  result.state = TrackingState::kInitializing;
  EnterMapping();
  const Pose start = records.empty() ? Pose() : last_T_camera_world_.Inverse();
  if (rig.sensor == Sensor::kMono) {
    const double depth = last_keyframe_ >= 0 ? std::max(1e-6, map().MedianDepth(last_keyframe_)) : 1.0;
    const std::vector<TrackedFrame> before = initializer_.pending();
    if (!initializer_.Offer(frame, piece_, start, depth > 1e-6 ? depth : 1.0, &map_, &result.reason))
      return result;
    const int second = map().KeyframeCount() - 1;
    last_keyframe_ = reference_ = second;
    initializer_.Reset();
    PoseBackwards(before, second - 1);
  } else {
    const auto with_depth = std::count_if(frame.features->inverse_depth.begin(),
                                          frame.features->inverse_depth.end(), [](float d) { return d > 0; });
    if (with_depth < kMinDepthFeatures) {
      result.reason = "initialising: only " + std::to_string(with_depth) + " features with depth";
      return result;
    }
    tutti::Keyframe k;
    k.frame_index = frame.index;
    k.stamp_s = frame.stamp_s;
    k.piece = piece_;
    k.features = frame.features;
    k.T_world_camera = start;
    last_keyframe_ = reference_ = map_.AddKeyframe(k);
    mapper_.AddDepthLandmarks(reference_, 100, &map_);
  }
  const tutti::Keyframe& k = map().keyframe(last_keyframe_);
  reference_landmarks_ =
      static_cast<int>(std::count_if(k.landmarks.begin(), k.landmarks.end(), [](int l) { return l >= 0; }));
  last_T_camera_world_ = k.T_world_camera.Inverse();
  last_stamp_ = frame.stamp_s;
  last_features_ = frame.features;
  last_matches_ = {last_features_.get(), k.landmarks};
  has_velocity_ = false;
  frames_since_keyframe_ = 0;
  Record(frame, last_T_camera_world_, last_keyframe_);
  state_ = TrackingState::kTracking;
  result.state = state_;
  result.T_world_camera = k.T_world_camera;
  result.keyframe = last_keyframe_;
  mapped.push_back(last_keyframe_);
  result.inliers = reference_landmarks_;
  return result;
}

// Frames from before the initialisation, from the first keyframe outwards on both sides; each starts from its
// neighbour.
void Odometry::Impl::PoseBackwards(const std::vector<TrackedFrame>& frames, int first_keyframe) {
  const tutti::Keyframe &k0 = map().keyframe(first_keyframe), &k1 = map().keyframe(first_keyframe + 1);
  const double span = std::max(1e-6, k1.stamp_s - k0.stamp_s);
  const Vector6d motion = LogSE3(k1.T_world_camera.Inverse() * k0.T_world_camera);
  std::vector<FrameRecord> posed;
  Pose neighbour = k0.T_world_camera.Inverse();
  bool backwards_alive = true;
  for (auto frame = frames.rbegin(); frame != frames.rend(); ++frame) {
    Pose T = neighbour;
    if (frame->index == k0.frame_index) {
      T = k0.T_world_camera.Inverse();
    } else {
      const bool between = frame->stamp_s > k0.stamp_s;
      if (!between && !backwards_alive) continue;
      if (between) T = ExpSE3(motion * ((frame->stamp_s - k0.stamp_s) / span)) * k0.T_world_camera.Inverse();
      FrameMatches seen{k0.features.get(), k0.landmarks};
      FrameMatches matches{frame->features.get(), std::vector<int>(frame->features->size(), -1)};
      MatchToLastFrame(map(), rig.camera, T, seen, 30.0F, &matches);
      if (Refine(&matches, &T) < options.min_inliers) {
        if (!between) backwards_alive = false;
        continue;
      }
    }
    if (frame->stamp_s <= k0.stamp_s) neighbour = T;
    FrameRecord record;
    record.index = frame->index;
    record.stamp_s = frame->stamp_s;
    record.reference = first_keyframe;
    record.T_reference_frame = k0.T_world_camera.Inverse() * T.Inverse();
    posed.push_back(record);
  }
  for (auto r = posed.rbegin(); r != posed.rend(); ++r) {
    if (records.empty() || r->stamp_s > records.back().stamp_s) records.push_back(*r);
  }
}

}  // namespace tutti
