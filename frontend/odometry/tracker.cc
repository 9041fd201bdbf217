// Tracking: frame by frame, keyframes, loss and recovery.
#include <algorithm>
#include <cmath>
#include <set>

#include "frontend/odometry/odometry_impl.h"
#include "frontend/odometry/stage_times.h"

namespace tutti {

Odometry::Impl::Impl(const OdometryOptions& o, const CameraRig& r)
    : options(o),
      rig(r),
      map_(PyramidScales(o), r.camera, o.aligned_sigma),
      mapper_(o, r),
      initializer_(o, r) {}

TrackResult Odometry::Impl::Track(const InputFrame& input) {
  if (mapping_.busy() && ++frames_since_mapping_began_ >= options.mapping_delay_frames) EnterMapping();
  TrackedFrame frame{input.index, input.stamp_s, input.features};
  if (!frame.features) {
    const ScopedStopwatch watch(&stages, Lane::kTracking, "extract");
    frame.features = std::make_shared<const FrameFeatures>(ExtractFeatures(input, rig, options));
  }
  frame.features = mapper_.lens().Correct(frame.features);
  if (rig.sensor == Sensor::kStereo) {
    row_errors.push_back(frame.features->row_error_px);
    stereo_matches.push_back(frame.features->stereo_matches);
  }
  lost_result_ = state_ == TrackingState::kInitializing ? Initialize(frame) : TrackMap(frame);
  lost_result_.features = static_cast<int>(frame.features->size());
  lost_.reset();
  if (lost_result_.state != TrackingState::kTracking) lost_ = frame;
  return lost_result_;
}

TrackResult Odometry::Impl::RelocalizeAt(int keyframe) {
  if (!lost_) return lost_result_;
  Fix guess(*lost_), fix(*lost_);
  const ScopedStopwatch watch(&stages, Lane::kTracking, "relocalize");
  if (!GuessFromKeyframe(keyframe, &guess)) return lost_result_;
  std::vector<Pose> offered;
  Offer(2 * options.min_inliers, &guess, &offered, &fix);
  if (fix.inliers == 0) return lost_result_;
  lost_.reset();
  initializer_.Reset();
  state_ = TrackingState::kLost;  // the motion so far says nothing
  last_keyframe_ = keyframe;
  const int features = lost_result_.features;
  lost_result_ = Accept(std::move(fix));
  lost_result_.features = features;
  return lost_result_;
}

TrackResult Odometry::Impl::TrackMap(const TrackedFrame& frame) {
  Fix fix(frame);
  bool tracked = false;
  {
    const ScopedStopwatch watch(&stages, Lane::kTracking, "track");
    tracked = FindPose(&fix);
  }
  if (tracked) return Accept(std::move(fix));
  TrackResult result;
  result.inliers = fix.inliers;
  result.reason = frame.features->size() < static_cast<std::size_t>(options.min_inliers)
                      ? "lost: only " + std::to_string(frame.features->size()) + " features in the image"
                      : "lost: only " + std::to_string(fix.inliers) + " landmarks agree with a pose";
  state_ = TrackingState::kLost;
  result.state = state_;
  // A covered lens says nothing about the place.
  if (frame.features->size() < static_cast<std::size_t>(options.min_inliers)) return result;
  if (!lost_since_s_) lost_since_s_ = frame.stamp_s;
  if (frame.stamp_s - *lost_since_s_ > options.relocalize_s) Lose();
  return result;
}

std::vector<SeenLandmark> Odometry::Impl::SeenLandmarks() const {
  std::vector<SeenLandmark> seen;
  for (std::size_t f = 0; f < last_matches_.landmarks.size(); ++f) {
    if (last_matches_.landmarks[f] >= 0)
      seen.push_back({last_matches_.landmarks[f], last_features_->keypoints[f].pt});
  }
  return seen;
}

// The frame has this pose: it may become a keyframe, and is what the next one starts from.
TrackResult Odometry::Impl::Accept(Fix fix) {
  TrackResult result;
  const TrackedFrame& frame = fix.frame;
  const Pose& T = fix.T_camera_world;
  CountSeen(fix);
  reference_ = fix.reference;
  const double dt = frame.stamp_s - last_stamp_;
  has_velocity_ = state_ == TrackingState::kTracking && dt > 0 && dt < 1.0;
  if (has_velocity_) velocity_ = LogSE3(T * last_T_camera_world_.Inverse()) / dt;
  state_ = TrackingState::kTracking;
  lost_since_s_.reset();
  ++frames_since_keyframe_;
  result.state = state_;
  result.inliers = fix.inliers;
  const bool needed = NeedKeyframe(frame, fix.matches, fix.inliers);
  last_T_camera_world_ = T;
  last_stamp_ = frame.stamp_s;
  last_features_ = frame.features;
  last_matches_ = {last_features_.get(), std::move(fix.matches.landmarks)};
  if (needed) result.keyframe = InsertKeyframe(frame);
  Record(frame, last_T_camera_world_, reference_);
  result.T_world_camera = last_T_camera_world_.Inverse();
  return result;
}

void Odometry::Impl::CountSeen(const Fix& fix) {
  if (mapping_.busy()) {
    visible_.insert(visible_.end(), fix.visible.begin(), fix.visible.end());
    found_.insert(found_.end(), fix.found.begin(), fix.found.end());
    return;
  }
  for (int l : fix.visible) ++map_.landmark(l).visible;
  for (int l : fix.found) {
    if (l >= 0) ++map_.landmark(l).found;
  }
}

void Odometry::Impl::EnterMapping() {
  if (!mapping_.busy()) return;
  const Pose old_reference = reference_ >= 0 ? map().keyframe(reference_).T_world_camera : Pose();
  {
    const ScopedSpan span(stages.recorder, Lane::kTracking, "wait_for_mapping");
    const std::shared_ptr<const BackgroundMapping::Outcome> outcome = mapping_.Take();
    map_ = outcome->map;
    mapper_ = outcome->mapper;
    for (const auto& [stage, ms] : outcome->stages.milliseconds) stages.milliseconds[stage] += ms;
  }
  mapped.push_back(mapping_.keyframe());
  const auto count = [this](std::vector<int>* landmarks, int Landmark::*counter) {
    for (int l : *landmarks) {
      const int present = map().Present(l);
      if (present >= 0) ++(map_.landmark(present).*counter);
    }
    landmarks->clear();
  };
  count(&visible_, &Landmark::visible);
  count(&found_, &Landmark::found);
  if (reference_ >= 0) MoveCurrent(old_reference, Similarity(map().keyframe(reference_).T_world_camera));
  std::set<int> taken;  // merged landmarks were two in the last frame
  for (int& l : last_matches_.landmarks) {
    l = map().Present(l);
    if (l >= 0 && !taken.insert(l).second) l = -1;
  }
  if (frames_since_keyframe_ == 0) last_matches_.landmarks = map().keyframe(last_keyframe_).landmarks;
}

void Odometry::Impl::Lose() {
  // Nothing found for too long: a new piece of map starts; a loop closure may join the two later.
  ++piece_;
  state_ = TrackingState::kInitializing;
  lost_since_s_.reset();
  initializer_.Reset();
  has_velocity_ = false;
}

// Makes the last tracked frame a keyframe.
int Odometry::Impl::InsertKeyframe(const TrackedFrame& frame) {
  EnterMapping();
  tutti::Keyframe k;
  k.frame_index = frame.index;
  k.stamp_s = frame.stamp_s;
  k.piece = map().keyframe(reference_).piece;
  k.features = frame.features;
  k.T_world_camera = last_T_camera_world_.Inverse();
  const int id = map_.AddKeyframe(k);
  for (std::size_t f = 0; f < last_matches_.landmarks.size(); ++f) {
    const int l = last_matches_.landmarks[f];
    if (l >= 0 && map().landmark(l).alive) map_.AddObservation(l, id, static_cast<int>(f));
  }
  if (rig.sensor != Sensor::kMono) mapper_.AddDepthLandmarks(id, 100, &map_);
  last_matches_.landmarks = map().keyframe(id).landmarks;
  last_keyframe_ = reference_ = id;
  frames_since_keyframe_ = 0;
  mapping_.Start(id, map_, mapper_, stages.recorder, own_threads);
  frames_since_mapping_began_ = 0;
  if (options.mapping_delay_frames == 0) EnterMapping();
  return id;
}

void Odometry::Impl::Record(const TrackedFrame& frame, const Pose& T_camera_world, int reference) {
  FrameRecord record;
  record.index = frame.index;
  record.stamp_s = frame.stamp_s;
  record.reference = reference;
  record.T_reference_frame = map().keyframe(reference).T_world_camera.Inverse() * T_camera_world.Inverse();
  records.push_back(record);
}

void Odometry::Impl::MoveCurrent(const Pose& old_reference, const Similarity& S) {
  const Pose T_world_camera = last_T_camera_world_.Inverse();
  Pose relative = old_reference.Inverse() * T_world_camera;
  relative.translation *= S.scale;
  last_T_camera_world_ = (Pose(S.rotation, S.translation) * relative).Inverse();
  velocity_.head<3>() *= S.scale;
}

}  // namespace tutti
