#include "frontend/odometry/odometry_impl.h"

#include <set>
#include <utility>

#include "core/dense_solvers.h"
#include "frontend/map/global_adjustment.h"
#include "frontend/map/landmark_fusion.h"
#include "frontend/map/map_correction.h"
#include "frontend/map/measured.h"
#include "frontend/map/other_camera.h"
#include "frontend/map/redundant_keyframes.h"
#include "frontend/map/scale_ramp.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr int kRamp = 40, kShortestRamp = 10;  // keyframes that a drift of the scale is spread over
constexpr double kKnown = 0.3;                 // share of landmarks by which a place is one seen before
constexpr int kStartRounds = 2;                // of finding how a rolling shutter's first frame moved

}  // namespace

Odometry::Impl::Impl(const OdometryOptions& options, const CameraRig& rig)
    : options_(options),
      rig_(rig),
      mapper_(options, rig),
      initializer_(options, rig),
      tracker_(options, rig),
      rolling_start_(rig),
      relocalizer_(options, rig),
      follower_(options, rig),
      localizer_(options, rig) {}

void Odometry::Impl::GoOn(const Impl& before, std::int64_t frame_offset) {
  UseOwnThreads(before.mapper_.own_threads());
  SetRecorder(before.stages_.recorder);
  if (SameCamera(before.rig_, rig_)) {
    *mapper_.RestoredMap() = before.map();
    mapper_.KeepLens(before.mapper_.lens());
  } else {
    CarryOver(before.map(), before.rig_.camera, rig_.camera, mapper_.RestoredMap());
  }
  history_ = before.history_;
  history_.BeginSession();
  session_piece_ = before.initializer_.piece() + 1;
  initializer_.BeginSession(session_piece_);
  frame_offset_ = frame_offset;
}

void Odometry::Impl::Append(const Impl& other, std::int64_t frame_offset) {
  Map converted(map().scales());
  const bool same = SameCamera(other.rig_, rig_);
  if (!same) CarryOver(other.map(), other.rig_.camera, rig_.camera, &converted);
  history_.Append(other.history_, frame_offset, map().KeyframeCount());
  mapper_.MutableMap()->Append(same ? other.map() : converted, frame_offset, session_piece_);
  initializer_.BeginSession(session_piece_ + other.initializer_.piece() + 1);
  frame_offset_ = frame_offset + other.frame_offset_;
}

TrackResult Odometry::Impl::Track(const InputFrame& input) {
  mapper_.NextFrame();
  if (mapper_.Due()) EnterMapping();
  if (tracker_.state() == TrackingState::kInitializing) {
    const TrackedFrame frame = Prepare(input, options_.features);
    result_ = Initialize(frame);
    result_.features = static_cast<int>(frame.features->size());
    return result_;
  }
  const bool few = !input.features && localizer_.features() < options_.features;
  TrackedFrame frame = Prepare(input, localizer_.features());
  const Pose T_last_world = last().T_camera_world;
  const std::optional<Tracker> before = few ? std::optional(tracker_) : std::nullopt;
  Tracker::Tracked tracked = Look(frame);
  if (few && (!tracked.fix || localizer_.Doubts(*tracked.fix, last().frames_since_keyframe))) {
    tracker_ = *before;
    frame = Prepare(input, options_.features);
    tracked = Look(frame);
  }
  if (tracked.fix && rig_.sensor == Sensor::kMono && options_.keep_height && !localizer_.Begun())
    height_.See(rig_.camera, frame.features, last().T_camera_world, T_last_world,
                map().MedianDepth(last().reference));
  result_ = TrackMap(frame, tracked);
  result_.features = static_cast<int>(frame.features->size());
  return result_;
}

Tracker::Tracked Odometry::Impl::Look(const TrackedFrame& frame) {
  const ScopedStopwatch watch(&stages_, Lane::kTracking, "track");
  return rolling_start_.Is(last()) ? LookFromStart(frame) : tracker_.Track(frame, map());
}

// Of the second frame of a piece, which tells how the camera moved in the first.
Tracker::Tracked Odometry::Impl::LookFromStart(const TrackedFrame& frame) {
  EnterMapping();
  const Tracker start = tracker_;
  const int first = last().reference;
  const std::shared_ptr<const FrameFeatures> seen = last().frame.features;
  Tracker::Tracked tracked = tracker_.Track(frame, map());
  Vector6d motion = Vector6d::Zero();
  for (int round = 0; round < kStartRounds && tracked.fix; ++round) {
    const std::optional<Vector6d> found = RollingStart::MotionOf(start.last(), *tracked.fix, motion);
    if (!found) break;
    motion = *found;
    tracker_ = start;
    tracker_.Straighten(rolling_start_.Straighten(*seen, motion, first, mapper_.MutableMap()), motion);
    tracked = tracker_.Track(frame, map());
  }
  if (tracked.fix || motion.isZero()) return tracked;
  tracker_ = start;
  rolling_start_.Straighten(*seen, Vector6d::Zero(), first, mapper_.MutableMap());
  return tracker_.Track(frame, map());
}

TrackResult Odometry::Impl::Follow(const InputFrame& input, const Pose& T_odom_camera) {
  mapper_.NextFrame();
  if (mapper_.Due()) EnterMapping();
  const TrackedFrame frame = Prepare(input, options_.features);
  if (!follower_.started()) {
    result_ = FollowFirst(frame, T_odom_camera);
  } else {
    const ScopedStopwatch watch(&stages_, Lane::kTracking, "follow");
    const Pose T_world_camera = follower_.Next(T_odom_camera, tracker_.last().T_camera_world.Inverse());
    const int newest = tracker_.last().newest_keyframe;
    const PoseFollower::Sight sight = follower_.See(map(), frame, newest, T_world_camera.Inverse());
    const PoseFix& fix = sight.fix;
    tracker_.Follow(fix);
    result_ = TrackResult();
    result_.state = TrackingState::kTracking;
    result_.inliers = fix.inliers;
    if (follower_.WantsKeyframe(map(), fix, newest)) {
      result_.step = follower_.Check(map(), sight, newest);
      result_.keyframe = InsertKeyframe();
    }
    const LastFrame& last = tracker_.last();
    history_.Add(last.frame, last.T_camera_world, map().keyframe(last.reference));
    result_.T_world_camera = last.T_camera_world.Inverse();
  }
  result_.features = static_cast<int>(frame.features->size());
  return result_;
}

// The map's frame of reference is the other odometry's.
TrackResult Odometry::Impl::FollowFirst(const TrackedFrame& frame, const Pose& T_odom_camera) {
  TrackResult result;
  if (rig_.sensor != Sensor::kMono && !frame.features->has_depth) {
    result.reason = "initialising: waiting for a frame with depth";
    return result;
  }
  mapper_.KeepPoses();
  const Pose T_world_camera = follower_.Next(T_odom_camera, Pose());
  result.keyframe = mapper_.AddKeyframe(frame, initializer_.piece(), T_world_camera, {});
  const tutti::Keyframe& keyframe = map().keyframe(result.keyframe);
  tracker_.Begin(frame, keyframe);
  history_.Add(frame, tracker_.last().T_camera_world, keyframe);
  mapper_.Skip(result.keyframe);
  result.state = TrackingState::kTracking;
  result.T_world_camera = T_world_camera;
  return result;
}

TrackedFrame Odometry::Impl::Prepare(const InputFrame& input, int features) {
  TrackedFrame frame{input.index + frame_offset_, input.stamp_s, input.features};
  if (!frame.features) {
    const ScopedStopwatch watch(&stages_, Lane::kTracking, "extract");
    OdometryOptions options = options_;
    options.features = features;
    frame.features = std::make_shared<const FrameFeatures>(ExtractFeatures(input, rig_, options));
  }
  frame.features = mapper_.lens().Correct(frame.features);
  if (rig_.sensor == Sensor::kStereo && frame.features->has_depth) {
    row_errors_.push_back(frame.features->row_error_px);
    stereo_matches_.push_back(frame.features->stereo_matches);
  }
  return frame;
}

TrackResult Odometry::Impl::Initialize(const TrackedFrame& frame) {
  const ScopedStopwatch watch(&stages_, Lane::kTracking, "initialize");
  EnterMapping();
  MapInitializer::Start start = initializer_.Offer(frame, tracker_.last(), &mapper_);
  TrackResult result;
  if (start.keyframe < 0) {
    relocalizer_.Wait(frame);
    result.reason = std::move(start.reason);
    return result;
  }
  for (const auto& [earlier, T_camera_world] : start.before) {
    if (history_.IsLater(earlier.stamp_s))
      history_.Add(earlier, T_camera_world, map().keyframe(start.before_reference));
  }
  const tutti::Keyframe& keyframe = map().keyframe(start.keyframe);
  tracker_.Begin(frame, keyframe);
  height_.Forget();
  relocalizer_.Found();
  history_.Add(frame, tracker_.last().T_camera_world, keyframe);
  mapper_.Skip(start.keyframe);
  result.state = TrackingState::kTracking;
  result.T_world_camera = keyframe.T_world_camera;
  result.keyframe = start.keyframe;
  for (const int landmark : keyframe.landmarks) result.inliers += landmark >= 0 ? 1 : 0;
  return result;
}

TrackResult Odometry::Impl::TrackMap(const TrackedFrame& frame, const Tracker::Tracked& tracked) {
  if (tracked.fix) return Accept(tracked);
  localizer_.Lost();
  if (relocalizer_.Lose(frame) && !localizer_.Begun()) {  // a loop closure may join the two pieces later
    tracker_.GiveUp();
    initializer_.NextPiece();
  }
  TrackResult result;
  result.state = TrackingState::kLost;
  result.reason = frame.features->size() < static_cast<std::size_t>(options_.min_inliers)
                      ? "lost: only " + std::to_string(frame.features->size()) + " features in the image"
                      : "lost: no pose that enough landmarks agree with";
  return result;
}

TrackResult Odometry::Impl::RelocalizeAt(int keyframe) {
  if (!relocalizer_.HasFrame()) return result_;
  const ScopedStopwatch watch(&stages_, Lane::kTracking, "relocalize");
  std::optional<PoseFix> fix = relocalizer_.FindAt(keyframe, map());
  if (!fix) return result_;
  initializer_.Reset();
  const int features = result_.features;
  result_ = Accept(tracker_.Relocalize(keyframe, *std::move(fix), map()));
  result_.features = features;
  return result_;
}

void Odometry::Impl::BeginLocalization() {
  EnterMapping();
  localizer_.Begin(map());
  mapper_.KeepMap();
  initializer_.Reset();
  tracker_.Forget();
  relocalizer_.Found();
  history_ = FrameHistory();
  result_ = TrackResult();
}

std::optional<Matrix6d> Odometry::Impl::PoseCovariance() const {
  const LastFrame& last = tracker_.last();
  if (last.reference < 0) return std::nullopt;
  Matrix6d information = Matrix6d::Zero();
  for (std::size_t f = 0; f < last.matches.landmarks.size(); ++f) {
    const int landmark = last.matches.landmarks[f];
    if (landmark < 0 || !map().landmark(landmark).alive) continue;
    const PointObservation seen =
        Measured(map(), *last.matches.features, {-1, static_cast<int>(f)}, landmark, options_.pixel_sigma);
    Eigen::Vector3d residual;
    Eigen::Matrix<double, 3, 6> by_pose;
    if (!ReprojectionResidual(rig_.camera, last.T_camera_world, seen, &residual, &by_pose)) continue;
    information += by_pose.transpose() * by_pose;
  }
  const auto covariance = internal::InverseInformation(information);
  if (!covariance) return std::nullopt;
  // Exp(d) T_camera_world is T_world_camera Exp(-d): the camera moves by -R_world_camera d in the world.
  Matrix6d turn = Matrix6d::Identity();
  turn.topLeftCorner<3, 3>() = last.T_camera_world.rotation.conjugate().toRotationMatrix();
  return turn * Matrix6d(*covariance) * turn.transpose();
}

TrackResult Odometry::Impl::Accept(const Tracker::Tracked& tracked) {
  relocalizer_.Found();
  mapper_.CountSeen(*tracked.fix);
  if (tracked.by_grey_before > 0 && tracked.fix->drift)
    history_.Spread(map(), tracked.by_grey_before, *tracked.fix->drift, tracked.fix->T_camera_world.rotation);
  TrackResult result;
  result.state = TrackingState::kTracking;
  result.inliers = tracked.fix->inliers;
  result.by_grey_values = tracked.fix->by_grey;
  localizer_.Found(*tracked.fix, map());
  if (BecomesKeyframe(tracked)) result.keyframe = InsertKeyframe();
  const LastFrame& last = tracker_.last();
  history_.Add(last.frame, last.T_camera_world, map().keyframe(last.reference));
  result.T_world_camera = last.T_camera_world.Inverse();
  if (localizer_.Beyond()) relocalizer_.Wait(last.frame);
  return result;
}

bool Odometry::Impl::BecomesKeyframe(const Tracker::Tracked& tracked) const {
  return localizer_.Begun() ? localizer_.MustExtend(*tracked.fix, last().frames_since_keyframe)
                            : tracked.need != KeyframeNeed::kNone;
}

// Makes the last tracked frame a keyframe.
int Odometry::Impl::InsertKeyframe() {
  EnterMapping();
  KeepScale();
  const LastFrame& last = tracker_.last();
  const int id = mapper_.AddKeyframe(last.frame, map().keyframe(last.reference).piece,
                                     last.T_camera_world.Inverse(), last.matches.landmarks);
  tracker_.BecomeKeyframe(map().keyframe(id));
  mapper_.Start(id, stages_);
  if (mapper_.Due()) EnterMapping();
  return id;
}

void Odometry::Impl::EnterMapping() {
  if (!mapper_.Busy()) return;
  const int reference = tracker_.last().reference;
  const Pose T_world_old = map().keyframe(reference).T_world_camera;
  mapper_.Enter(&stages_);
  tracker_.FollowReference(T_world_old, Similarity(map().keyframe(reference).T_world_camera));
  tracker_.FollowLandmarks(map());
}

void Odometry::Impl::Correct(const std::map<int, Similarity>& S_world_keyframe,
                             const std::map<int, int>& merges, const GlobalAdjustment::Work* adjustment) {
  EnterMapping();
  first_unmoved_ = map().KeyframeCount();
  const auto here = S_world_keyframe.find(last().reference);
  if (here != S_world_keyframe.end()) height_.Follow(here->second.scale);
  MoveMap(S_world_keyframe, merges, adjustment);
}

// Takes the drift that CameraHeight tells out of the newest keyframes. What a loop has moved stays, and so
// does the map where the camera sees what it has seen long before.
void Odometry::Impl::KeepScale() {
  const std::optional<double> drift = height_.Drift();
  const int newest = last().newest_keyframe, first = std::max(first_unmoved_, newest - kRamp);
  if (!drift || newest - first < kShortestRamp) return;
  int all = 0, old = 0;
  for (const int l : last().matches.landmarks) {
    if (l < 0 || !map().landmark(l).alive) continue;
    ++all;
    old += map().landmark(l).reference < first ? 1 : 0;
  }
  if (old > kKnown * all) return;
  const std::map<int, Similarity> moved = ScaleRamp(map(), first, newest, -*drift);
  const auto here = moved.find(last().reference);
  if (here == moved.end()) return;
  height_.Correct(here->second.scale);
  MoveMap(moved, {}, nullptr);
}

void Odometry::Impl::MoveMap(const std::map<int, Similarity>& S_world_keyframe,
                             const std::map<int, int>& merges, const GlobalAdjustment::Work* adjustment) {
  const int reference = tracker_.last().reference;
  if (reference >= 0) {
    const Pose& T_world_old = map().keyframe(reference).T_world_camera;
    const auto moved = S_world_keyframe.find(reference);
    if (moved != S_world_keyframe.end()) follower_.Rescale(moved->second.scale);
    tracker_.FollowReference(T_world_old.Inverse().Inverse(),
                             moved != S_world_keyframe.end() ? moved->second : Similarity(T_world_old));
  }
  history_.Rescale(S_world_keyframe);
  Map* const map = mapper_.MutableMap();
  MoveKeyframes(S_world_keyframe, map);
  if (adjustment != nullptr) TakeAdjustedLandmarks(adjustment->Result().landmarks, map);
  map->UpdateGeometry();
  JoinPieces(merges, map);
}

std::map<int, int> Odometry::Impl::RemoveRedundantKeyframes(
    const std::function<bool(int removed, int into)>& may) {
  if (localizer_.Begun()) throw InputError("frames are being located in the map: it must stay as it is");
  EnterMapping();
  const std::size_t least_views = rig_.sensor == Sensor::kMono ? 2 : 1;  // that tell where a landmark is
  const std::set<int> keep = {last().reference, last().newest_keyframe, result_.keyframe};
  tutti::FuseAll(rig_.camera, mapper_.MutableMap());
  std::map<int, int> removed = tutti::RemoveRedundantKeyframes(keep, least_views, may, mapper_.MutableMap());
  history_.Rehang(removed, map());
  tracker_.FollowLandmarks(map());
  mapper_.MutableMap()->Compact();
  return removed;
}

void Odometry::Impl::FuseAll() {
  EnterMapping();
  tutti::FuseAll(rig_.camera, mapper_.MutableMap());
  mapper_.MutableMap()->UpdateGeometry();
}

int Odometry::Impl::FuseLoop(int older, int newer, const Similarity& S_older_newer) {
  EnterMapping();
  return tutti::FuseLoop(rig_.camera, older, newer, S_older_newer.RigidPart(), mapper_.MutableMap());
}

}  // namespace tutti
