#include "frontend/odometry/map_initializer.h"

#include <algorithm>
#include <utility>

namespace tutti {
namespace {
constexpr int kMinDepthFeatures = 50;      // features with depth that a metric map starts from
constexpr float kBackwardsRadius = 30.0F;  // between neighbouring frames [px]; twice that if it fails
constexpr std::size_t kMaxWaiting = 100;   // frames kept to be posed backwards
constexpr int kFramesToRecognise = 3;      // of a session: with so many it starts a piece of its own
}  // namespace

MapInitializer::MapInitializer(const OdometryOptions& options, const CameraRig& rig, int piece)
    : options_(options),
      rig_(rig),
      mono_(options, rig),
      search_(options, rig),
      piece_(piece),
      hold_(piece > 0 ? kFramesToRecognise : 0) {}

void MapInitializer::Reset() {
  mono_.Reset();
  waiting_.clear();
  hold_ = 0;
}

void MapInitializer::NextPiece(const std::vector<TrackedFrame>& lost) {
  ++piece_;
  Reset();
  if (rig_.sensor == Sensor::kMono) {
    mono_.Await(lost);
  } else {
    waiting_ = lost;
  }
}

MapInitializer::Start MapInitializer::Offer(const TrackedFrame& frame, const LastFrame& last,
                                            AsyncMapper* mapper) {
  const Pose T_world_camera = last.reference < 0 ? Pose() : last.T_camera_world.Inverse();
  return rig_.sensor == Sensor::kMono ? OfferMono(frame, last, T_world_camera, mapper->MutableMap())
                                      : OfferMetric(frame, T_world_camera, mapper);
}

MapInitializer::Start MapInitializer::OfferMetric(const TrackedFrame& frame, const Pose& T_world_camera,
                                                  AsyncMapper* mapper) {
  const std::vector<float>& depths = frame.features->inverse_depth;
  const auto with_depth = std::count_if(depths.begin(), depths.end(), [](float d) { return d > 0; });
  Start start;
  const bool holds = hold_ > 0 && --hold_ > 0;
  if (with_depth < kMinDepthFeatures || holds) {
    start.reason = with_depth >= kMinDepthFeatures ? "initialising: the place is not recognised in the map"
                   : frame.features->has_depth
                       ? "initialising: only " + std::to_string(with_depth) + " features with depth"
                       : "initialising: waiting for a frame with depth";
    waiting_.push_back(frame);
    waiting_.back().features = WithoutImages(*frame.features);
    if (waiting_.size() > kMaxWaiting) waiting_.erase(waiting_.begin());
    return start;
  }
  start.keyframe = start.before_reference = mapper->AddKeyframe(frame, piece_, T_world_camera, {});
  const Map& made = mapper->map();
  const Keyframe& first = made.keyframe(start.keyframe);
  start.before = PoseBackwards(std::exchange(waiting_, {}), first, first, made);
  return start;
}

MapInitializer::Start MapInitializer::OfferMono(const TrackedFrame& frame, const LastFrame& last,
                                                const Pose& T_world_camera, Map* map) {
  Start start;
  const double depth = last.reference < 0 ? 0 : map->MedianDepth(last.newest_keyframe);
  const std::vector<TrackedFrame> before = mono_.pending();
  if (!mono_.Offer(frame, piece_, T_world_camera, depth > 1e-6 ? depth : 1.0, map, &start.reason))
    return start;
  mono_.Reset();
  start.keyframe = map->KeyframeCount() - 1;
  start.before_reference = start.keyframe - 1;
  const Map& made = *map;
  start.before =
      PoseBackwards(before, made.keyframe(start.before_reference), made.keyframe(start.keyframe), made);
  return start;
}

// From the first keyframe outwards on both sides; each frame starts from its neighbour.
std::vector<std::pair<TrackedFrame, Pose>> MapInitializer::PoseBackwards(
    const std::vector<TrackedFrame>& frames, const Keyframe& k0, const Keyframe& k1, const Map& map) const {
  const double span = std::max(1e-6, k1.stamp_s - k0.stamp_s);
  const Vector6d motion = LogSE3(k1.T_world_camera.Inverse() * k0.T_world_camera);
  const Pose T0 = k0.T_world_camera.Inverse();
  std::vector<std::pair<TrackedFrame, Pose>> posed;
  Pose neighbour = T0;
  bool backwards_alive = true;
  for (auto frame = frames.rbegin(); frame != frames.rend(); ++frame) {
    const bool between = frame->stamp_s > k0.stamp_s, first = frame->index == k0.frame_index;
    if (!first && !between && !backwards_alive) continue;
    Pose T = first ? T0 : neighbour;
    if (!first && between) T = ExpSE3(motion * ((frame->stamp_s - k0.stamp_s) / span)) * T0;
    if (!first) {
      bool found = false;
      for (const float radius : {kBackwardsRadius, 2 * kBackwardsRadius}) {
        FrameMatches matches{frame->features.get(), std::vector<int>(frame->features->size(), -1)};
        Pose guess = T;
        MatchToLastFrame(map, rig_.camera, T, {k0.features.get(), k0.landmarks}, radius, &matches);
        found = search_.Refine(map, &matches, &guess) >= options_.min_inliers;
        if (found) T = guess;
        if (found) break;
      }
      if (!found) {
        if (!between) backwards_alive = false;
        continue;
      }
    }
    if (!between) neighbour = T;
    posed.emplace_back(*frame, T);
  }
  std::reverse(posed.begin(), posed.end());
  return posed;
}

}  // namespace tutti
