#include "frontend/odometry/odometry_impl.h"

#include <utility>

#include "core/dense_solvers.h"
#include "core/numbers.h"
#include "frontend/map/append.h"
#include "frontend/map/fuse.h"
#include "frontend/map/global_adjustment.h"
#include "frontend/map/map_frames.h"
#include "frontend/map/measured.h"
#include "frontend/map/move_keyframes.h"
#include "frontend/map/scale_ramp.h"
#include "frontend/odometry/step_check.h"

namespace tutti {
namespace {

constexpr int kRamp = 40, kShortestRamp = 10;  // keyframes that a drift of the scale is spread over
constexpr double kKnown = 0.3;                 // share of landmarks by which a place is one seen before
constexpr int kRicher = 2;                     // times the features, where landmarks get few
constexpr int kMostFailed = 5;                 // frames in a row, in tracking backwards
constexpr int kStartRounds = 2;                // of finding how a rolling shutter's first frame moved

}  // namespace

Odometry::Impl::Impl(const OdometryOptions& options, const CameraRig& rig)
    : options_(options),
      rig_(rig),
      mapper_(options, rig),
      initializer_(options, rig),
      tracker_(options, rig),
      rolling_start_(rig),
      clocks_(rig, options),
      imu_(rig.imu.value_or(ImuCalibration())),
      relocalizer_(options, rig),
      follower_(options, rig),
      localizer_(options, rig),
      keeps_height_(rig.sensor == Sensor::kMono && options.keep_height) {}

void Odometry::Impl::GoOn(const Impl& before, Map map, std::int64_t frame_offset) {
  UseOwnThreads(before.mapper_.own_threads());
  SetRecorder(before.recorder());
  if (SameCamera(before.rig_, rig_)) mapper_.KeepLens(before.mapper_.lens());
  session_piece_ = map.NextPiece();
  frames_before_session_ = map.frames().size();
  *mapper_.RestoredMap() = std::move(map);
  initializer_ = MapInitializer(options_, rig_, session_piece_);
  frame_offset_ = frame_offset;
}

TrackResult Odometry::Impl::Track(const InputFrame& input) {
  mapper_.NextFrame();
  if (mapper_.Due()) EnterMapping();
  imu_.Add(input.imu);
  if (tracker_.state() == TrackingState::kInitializing) {
    const TrackedFrame frame = Prepare(input, options_.features);
    result_ = Initialize(frame);
    result_.features = static_cast<int>(frame.features->size());
    return result_;
  }
  const Pose T_last_world = last().T_camera_world;
  const double last_stamp_s = last().frame.stamp_s, last_s = last().frame.Time();
  const auto [frame, tracked] = Look(input);
  if (!imu_.empty()) {
    gravity_.AddFrame(frame.index, frame.Time());
    gravity_.Take(imu_);
  }
  if (tracked.fix) CompareTurn(T_last_world, last_s, *tracked.fix);
  if (tracked.fix && keeps_height_)
    height_.See(rig_.camera, frame.features, last().T_camera_world, T_last_world,
                map().MedianDepth(last().reference), last().frame.stamp_s - last_stamp_s);
  result_ = TrackMap(frame, tracked);
  result_.features = static_cast<int>(frame.features->size());
  return result_;
}

// The camera's turn from the frame before, as landmarks say, with that of the IMU.
void Odometry::Impl::CompareTurn(const Pose& T_last_world, double last_s, const PoseFix& fix) {
  if (imu_.empty() || fix.by_grey) return;
  imu_.AddStep(last_s, fix.frame.Time(), T_last_world.rotation * fix.T_camera_world.rotation.conjugate());
}

// With as many features as the pose needs; where those leave a doubt, once more with all. One camera has
// landmarks of common features alone: where they get too few for the next frame, it looks for more features.
std::pair<TrackedFrame, Tracker::Tracked> Odometry::Impl::Look(const InputFrame& input) {
  const int features = localizer_.features();
  const bool few = !input.features && features < options_.features;
  const bool enriches = rig_.sensor == Sensor::kMono && !localizer_.Begun() && !input.image.empty() &&
                        tracker_.state() == TrackingState::kTracking;
  const std::optional<Tracker> before = few || enriches ? std::optional(tracker_) : std::nullopt;
  TrackedFrame frame = Prepare(input, features);
  Tracker::Tracked tracked = Look(frame);
  const bool thin = enriches && (!tracked.fix || tracked.need == KeyframeNeed::kThin);
  const bool doubtful =
      few && (!tracked.fix || localizer_.Doubts(*tracked.fix, last().frames_since_keyframe));
  if (!thin && !doubtful) return {std::move(frame), std::move(tracked)};
  const Tracker after = std::exchange(tracker_, *before);
  InputFrame image = input;
  image.features.reset();
  TrackedFrame again = Prepare(image, thin ? kRicher * options_.features : options_.features);
  Tracker::Tracked better = Look(again);
  if (doubtful || better.fix) return {std::move(again), std::move(better)};
  tracker_ = after;
  return {std::move(frame), std::move(tracked)};
}

Tracker::Tracked Odometry::Impl::Look(const TrackedFrame& frame) {
  const ScopedStopwatch watch(&stages_, Lane::kTracking, "track");
  return rolling_start_.Is(last()) ? LookFromStart(frame) : tracker_.Track(frame, map());
}

// The second frame of a submap tells how the camera moved in the first.
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
    AddFrame(last.frame, last.T_camera_world, last.reference);
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
  AddFrame(frame, tracker_.last().T_camera_world, keyframe.id);
  mapper_.Skip(result.keyframe);
  result.state = TrackingState::kTracking;
  result.T_world_camera = T_world_camera;
  return result;
}

TrackedFrame Odometry::Impl::Prepare(const InputFrame& input, int features) {
  TrackedFrame frame{input.index + frame_offset_, input.stamp_s, input.features, input.clock_s};
  if (!imu_.empty() && last().reference >= 0) frame.turn = imu_.CameraTurn(last().frame.Time(), frame.Time());
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
    if (IsLater(earlier.stamp_s)) AddFrame(earlier, T_camera_world, start.before_reference);
  }
  const tutti::Keyframe& keyframe = map().keyframe(start.keyframe);
  TrackedFrame begun = frame;
  begun.features = keyframe.features;  // straightened, if its rows were read one after the other
  tracker_.Begin(begun, keyframe);
  height_.Forget();
  relocalizer_.Found();
  relocalizer_.TakeLost();
  AddFrame(frame, tracker_.last().T_camera_world, keyframe.id);
  mapper_.Skip(start.keyframe);
  result.state = TrackingState::kTracking;
  result.T_world_camera = keyframe.T_world_camera;
  result.keyframe = start.keyframe;
  for (const int landmark : keyframe.landmarks) result.inliers += landmark >= 0 ? 1 : 0;
  return result;
}

TrackResult Odometry::Impl::TrackMap(const TrackedFrame& frame, const Tracker::Tracked& tracked) {
  if (tracked.fix) {
    TrackResult result = Accept(tracked, true);
    if (!localizer_.Begun()) clocks_.Add(map(), frame, *tracked.fix, last(), result.keyframe);
    return result;
  }
  clocks_.Break();
  localizer_.Lost();
  if (relocalizer_.Lose(frame) && !localizer_.Begun()) {  // a loop closure may join the two pieces later
    tracker_.GiveUp();
    initializer_.NextPiece(relocalizer_.Lost());
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
  result_ = Accept(tracker_.Relocalize(keyframe, *std::move(fix), map()), false);
  result_.features = features;
  return result_;
}

void Odometry::Impl::BeginLocalization() {
  EnterMapping();
  localizer_.Begin(map());
  keeps_height_ = false;
  mapper_.KeepMap();
  initializer_.Reset();
  tracker_.Forget();
  relocalizer_.Found();
  relocalizer_.TakeLost();
  mapper_.MapOfFrames()->TakeFrames(Map(map().scales()));
  frames_before_session_ = 0;
  result_ = TrackResult();
}

void Odometry::Impl::AddFrame(const TrackedFrame& frame, const Pose& T_camera_world, int keyframe,
                              bool goes_on) {
  mapper_.MapOfFrames()->AddFrame(frame.index, frame.stamp_s, keyframe, T_camera_world, goes_on);
}

// Than all frames of this recording.
bool Odometry::Impl::IsLater(double stamp_s) const {
  const std::size_t frames = map().frames().size();
  return frames == frames_before_session_ || stamp_s > map().frames()[frames - 1].stamp_s;
}

FrameView Odometry::Impl::LastView() const {
  const LastFrame& last = tracker_.last();
  FrameView view;
  view.keyframe = localizer_.keyframe() >= 0 ? localizer_.keyframe() : last.reference;
  view.newest_keyframe = last.newest_keyframe;
  view.frame_offset = frame_offset_;
  view.session_piece = session_piece_;
  view.beyond_map = localizer_.Beyond();
  for (std::size_t f = 0; f < last.matches.landmarks.size(); ++f) {
    const int landmark = last.matches.landmarks[f];
    if (landmark >= 0) view.landmarks.push_back({landmark, last.frame.features->keypoints[f].pt});
  }
  return view;
}

OdometryReport Odometry::Impl::Report() const {
  OdometryReport report;
  report.stage_ms = stages_.milliseconds;
  report.stereo_row_error_px = internal::Median(row_errors_);
  report.stereo_matches = internal::Median(stereo_matches_);
  if (mapper_.lens().Enabled()) report.lens = mapper_.lens().Found();
  report.height = height_.Found();
  report.clocks = clocks_.Found();
  if (!imu_.empty()) {
    report.imu = imu_.report();
    report.imu->turns = imu_.Turns();
    const Trajectory poses = FrameTrajectory(map());
    const std::vector<std::int64_t> numbers = FrameIndices(map());
    std::map<std::int64_t, Pose> T_world_camera;
    for (std::size_t i = 0; i < numbers.size(); ++i) T_world_camera[numbers[i]] = poses[i].pose;
    gravity_.Find(T_world_camera, rig_.sensor != Sensor::kMono, &*report.imu);
  }
  return report;
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

TrackResult Odometry::Impl::Accept(const Tracker::Tracked& tracked, bool goes_on) {
  relocalizer_.Found();
  TrackLost();
  mapper_.CountSeen(*tracked.fix);
  if (tracked.by_grey_before > 0 && tracked.fix->drift)
    SpreadDrift(tracked.by_grey_before, *tracked.fix->drift, tracked.fix->T_camera_world.rotation,
                mapper_.MapOfFrames());
  TrackResult result;
  result.state = TrackingState::kTracking;
  result.inliers = tracked.fix->inliers;
  result.by_grey_values = tracked.fix->by_grey;
  localizer_.Found(*tracked.fix, map());
  if (BecomesKeyframe(tracked)) result.keyframe = InsertKeyframe();
  const LastFrame& last = tracker_.last();
  AddFrame(last.frame, last.T_camera_world, last.reference, goes_on);
  if (result.keyframe >= 0 && rig_.sensor == Sensor::kMono && !localizer_.Begun() &&
      ImagesContradict(map(), rig_.camera, result.keyframe, options_.min_inliers)) {
    tracker_.GiveUp();  // a loop closure may join what follows
    initializer_.NextPiece({});
  }
  result.T_world_camera = last.T_camera_world.Inverse();
  if (localizer_.Beyond()) relocalizer_.Wait(last.frame);
  return result;
}

// The frames that were lost before the one that has just been found, backwards from there: a camera that
// comes back from a bare wall sees more and more of what it found again.
void Odometry::Impl::TrackLost() {
  std::vector<TrackedFrame> lost = relocalizer_.TakeLost();
  for (TrackedFrame& frame : lost) frame.turn.reset();  // it was from the other side
  if (localizer_.Begun()) return;
  Tracker backwards = tracker_;
  std::vector<LastFrame> found;
  int failed = 0;  // one after the other
  for (auto frame = lost.rbegin(); frame != lost.rend() && failed < kMostFailed; ++frame) {
    if (frame->index == last().frame.index) continue;  // it is the one that was found
    const bool posed = backwards.Track(*frame, map()).fix.has_value();
    failed = posed ? 0 : failed + 1;
    if (posed) found.push_back(backwards.last());
  }
  for (auto frame = found.rbegin(); frame != found.rend(); ++frame) {
    if (IsLater(frame->frame.stamp_s)) AddFrame(frame->frame, frame->T_camera_world, frame->reference, false);
  }
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

std::vector<int> Odometry::Impl::Correct(const MapCorrection& correction) {
  EnterMapping();
  if (!correction.S_world_keyframe.empty()) {
    first_unmoved_ = map().KeyframeCount();
    const auto here = correction.S_world_keyframe.find(last().reference);
    if (here != correction.S_world_keyframe.end()) height_.Rescale(here->second.scale);
    MoveMap(correction);
  }
  std::vector<int> common;
  for (const MapCorrection::Fusion& loop : correction.fused)
    common.push_back(
        FuseLoop(rig_.camera, loop.older, loop.newer, loop.S_older_newer.RigidPart(), mapper_.MutableMap()));
  return common;
}

void Odometry::Impl::Replace(Map map) {
  EnterMapping();
  *mapper_.MutableMap() = std::move(map);
  if (last().reference >= 0) tracker_.FollowLandmarks(mapper_.map());
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
  MapCorrection ramp;
  ramp.S_world_keyframe = ScaleRamp(map(), first, newest, -*drift);
  const auto here = ramp.S_world_keyframe.find(last().reference);
  if (here == ramp.S_world_keyframe.end()) return;
  height_.Correct(here->second.scale);
  MoveMap(ramp);
}

void Odometry::Impl::MoveMap(const MapCorrection& correction) {
  const int reference = tracker_.last().reference;
  if (reference >= 0) {
    const Pose& T_world_old = map().keyframe(reference).T_world_camera;
    const auto moved = correction.S_world_keyframe.find(reference);
    const bool moves = moved != correction.S_world_keyframe.end();
    if (moves) follower_.Rescale(moved->second.scale);
    tracker_.FollowReference(T_world_old, moves ? moved->second : Similarity(T_world_old));
  }
  Map* const map = mapper_.MutableMap();
  MoveKeyframes(correction.S_world_keyframe, map);
  if (correction.adjustment) TakeAdjustedLandmarks(correction.adjustment->work_->Result().landmarks, map);
  map->UpdateGeometry();
  JoinPieces(correction.merges, map);
}

}  // namespace tutti
