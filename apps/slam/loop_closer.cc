#include "apps/slam/loop_closer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "apps/slam/odometry_jumps.h"
#include "core/numbers.h"
#include "core/stopwatch.h"
#include "frontend/map/fuse.h"
#include "frontend/map/prune.h"

namespace tutti {
namespace {

constexpr const char* kDecidedLater = "decided anew by the images that came next: in a line further down";
constexpr int kCovisible = 3;  // most edges from a keyframe to older ones that see the same, the strongest

LoopDetectorOptions DetectorOptions(const RunConfig& config) {
  LoopDetectorOptions options = config.loops;
  options.threads = std::min(options.threads, config.run.threads);
  return options;
}

KeyframeGraphOptions GraphOptions(const RunConfig& config, Sensor sensor) {
  KeyframeGraphOptions options;
  options.kind = sensor == Sensor::kMono ? GraphKind::kSim3 : GraphKind::kSE3;
  options.solver = config.graph;
  options.sigma_translation_ratio = config.run.odometry_sigma_fraction;
  options.sigma_rotation_rad = config.run.odometry_sigma_deg * internal::kRadians;
  options.sigma_log_scale = kOdometrySigmaScale;
  options.max_covisible = kCovisible;
  return options;
}

// A place may be certain where the motion is not. Without a camera there is none, and the place is all.
bool GivesConstraint(const Verification& v) {
  return v.accepted || v.type == ConstraintType::kFundamental || v.type == ConstraintType::kNone;
}

LoopQuery Query(const InputFrame& frame, const CameraRig& rig) {
  LoopQuery query;
  // One camera's landmarks have a scale of their own, which drifts: no metre is to be read from them.
  query.metric = rig.sensor != Sensor::kMono;
  query.id = frame.index;
  query.stamp_s = frame.stamp_s;
  query.image = frame.image;
  query.depth_m = frame.depth_m;
  query.mask = frame.mask;
  return query;
}

}  // namespace

LoopCloser::LoopCloser(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder,
                       LoopListener listener, bool resumes)
    : recorder_(recorder),
      listener_(std::move(listener)),
      options_(config.run),
      rig_(rig),
      detector_(config.loops),
      pixel_sigma_(config.odometry.pixel_sigma),
      followed_(config.run, rig.sensor),
      gate_(config.run),
      graph_(GraphOptions(config, rig.sensor)) {
  if (!config.run.loops) return;
  worker_ = std::make_unique<LoopWorker>(DetectorOptions(config), config.run.threads > 1, recorder, resumes);
}

void LoopCloser::BeginSession(const CameraRig& rig, std::int64_t first_frame, int first_keyframe) {
  rig_ = rig;
  session_ = first_frame;
  sessions_.push_back(first_frame);
  keyframes_seen_ = 0;
  graph_.Append(first_keyframe);
  proof_.reset();
  corrections_ = adjustments_ = 0;
  stages_.clear();
  if (!worker_) return;
  worker_->Detector().BeginSession();
  waited_before_ = worker_->WaitedMs();
}

void LoopCloser::AddKeyframe(const InputFrame& frame, const KeyframeView* keyframe, std::int64_t frames) {
  if (!worker_ || keyframes_seen_++ % options_.loop_every_keyframes != 0) return;
  const bool first = stamps_.empty() || stamps_.rbegin()->first < session_;
  if (!first && frame.stamp_s - stamps_.rbegin()->second < options_.loop_min_interval_s) return;
  Ask(Query(frame, rig_), keyframe, frames);
}

void LoopCloser::Ask(LoopQuery query, const KeyframeView* view, std::int64_t frames) {
  if (view != nullptr) {
    query.camera = rig_.camera;
    if (options_.loop_pose_prior && query.metric) {
      query.pose_prior.emplace();
      query.pose_prior->position_m = view->T_world_camera.translation;
      query.pose_prior->frame = view->map_piece;
    }
    query.features = {view->keypoints, view->descriptors, view->points};
    keyframe_of_frame_[query.id] = view->id;
  }
  stamps_[query.id] = query.stamp_s;
  submitted_.push_back({frames + options_.loop_delay_frames, query.id});
  const internal::Stopwatch watch;
  worker_->Submit(std::move(query));
  if (options_.threads == 1) stages_["loop_inline"] += watch.Milliseconds();
}

int LoopCloser::Locate(const InputFrame& frame) {
  if (!worker_ || keyframe_of_frame_.empty()) return -1;
  LoopQuery query = Query(frame, rig_);
  query.camera = rig_.camera;
  const LoopResult found = worker_->Detector().Locate(query);
  return found.accepted ? KeyframeOf(found.candidate) : -1;
}

int LoopCloser::KeyframeOf(std::int64_t frame) const {
  const auto keyframe = keyframe_of_frame_.find(frame);
  return keyframe != keyframe_of_frame_.end() ? keyframe->second : -1;
}

void LoopCloser::Follow(const TrackResult& result, const StampedPose& T_odom_camera,
                        const std::optional<MotionSigma>& sigma, const Odometry& odometry) {
  if (result.step) {
    if (const auto step = followed_.NoteStep(result.keyframe, *result.step))
      graph_.NoteMotion(result.keyframe, *step);
  }
  followed_.Add(T_odom_camera);
  JudgeJumps(odometry.map(), false);
  if (!sigma) return;
  const bool said_nothing = followed_.motions() == 0;
  if (const auto motion = followed_.NoteMotion(result.keyframe, *sigma, T_odom_camera.pose.translation))
    graph_.NoteMotion(result.keyframe, *motion);
  if (said_nothing && followed_.motions() > 0) SetSigmas();  // what is configured no longer counts
}

// Marks jumps of the odometry in the graph, those up to the last pose as well if there are `all`.
void LoopCloser::JudgeJumps(const Map& map, bool all) {
  const std::vector<OdometryJump> jumps = followed_.TakeJumps(all);
  if (jumps.empty()) return;
  const std::vector<int> ids = map.KeyframeIds();
  const auto later = [&](double stamp_s) {
    return std::partition_point(ids.begin(), ids.end(),
                                [&](int id) { return map.keyframe(id).stamp_s < stamp_s; });
  };
  for (const OdometryJump& jump : jumps) {
    const auto end = later(jump.to_s);
    const int next = end == ids.end() ? map.KeyframeCount() : *end;
    if (!jump.comes_back) {
      if (followed_.ImagesConfirm(next, jump)) continue;
      graph_.NoteJump(next);
    }
    followed_.NoteJump(jump);
    if (!jump.comes_back) continue;
    for (auto outlier = later(std::nextafter(jump.from_s, jump.to_s)); outlier != end; ++outlier)
      graph_.NoteOutlier(*outlier);
  }
}

void LoopCloser::SetSigmas() {
  constexpr double kLeastRotation_rad = 1e-6;  // an edge is never certain
  const FollowedOdometry::Sigmas least = followed_.Least();
  graph_.SetSigmas(least.fraction, std::max(least.rotation_rad, kLeastRotation_rad));
}

void LoopCloser::Due(Odometry* odometry, std::int64_t frames) {
  do {
    if (odometry != nullptr && MayMove(frames) && listener_.before_change) listener_.before_change();
  } while (BringInNext(odometry, frames, Entering::kWhenDue));
}

void LoopCloser::Finish(Odometry* odometry, std::int64_t frames) {
  do {
    if (odometry != nullptr) JudgeJumps(odometry->map(), true);
  } while (BringInNext(odometry, frames, Entering::kAtOnce));
  Say();
}

// False: there is nothing.
bool LoopCloser::BringInNext(Odometry* odometry, std::int64_t frames, Entering entering) {
  const bool at_once = entering == Entering::kAtOnce;
  std::optional<Update> update;
  if (odometry != nullptr) update = Solved(*odometry, frames, entering);
  if (!update && late_) update = DeliverLate(odometry, frames);
  if (!update && !submitted_.empty() && (at_once || submitted_.front().due <= frames))
    update = Deliver(odometry, frames);
  if (!update && at_once && odometry != nullptr && CloseDeferred(*odometry, frames)) update.emplace();
  if (!update && odometry != nullptr) update = Adjusted(*odometry, frames, entering);
  if (!update) return false;
  Take(*update, odometry, frames);
  return true;
}

void LoopCloser::Take(const Update& update, Odometry* odometry, std::int64_t frames) {
  if (!update.correction) return;
  if (listener_.before_change) listener_.before_change();
  const internal::Stopwatch watch;
  const std::vector<int> common = odometry->Correct(*update.correction);
  Applied(update, common, *odometry, frames);
  stages_["loop_fuse"] += watch.Milliseconds();
}

// What became of those that still wait, and what there is to say of the odometry that is followed.
void LoopCloser::Say() {
  for (const std::size_t waiting : InState(LoopState::kWaiting)) {
    Loop& loop = loops_[waiting];
    loop.reason = loop.verified ? "no second loop nearby agreed with it"
                                : "no verified loop nearby agreed with it, and by itself it is doubtful";
  }
  const std::string uncertainty = followed_.Warning();
  if (!uncertainty.empty()) warnings_.push_back(uncertainty);
}

// The oldest answer.
LoopResult LoopCloser::TakeResult() {
  submitted_.pop_front();
  LoopResult result = worker_->Take();
  if (listener_.on_detection) listener_.on_detection(result);
  for (const auto& [name, ms] : LoopStages(result)) stages_[std::string("loop_") + name] += ms;
  if (!result.warning.empty() && result.warning != last_warning_) {
    last_warning_ = result.warning;
    warnings_.push_back(result.warning);
  }
  return result;
}

LoopCloser::Update LoopCloser::Deliver(const Odometry* odometry, std::int64_t frames) {
  const LoopResult result = TakeResult();
  late_ = result.late;
  if (!result.proposed) return {};
  return Decide(Proposed(result), result.verification, odometry, frames);
}

// What was said of an image comes with the answer to a later one: a fixed number of frames after it.
LoopCloser::Update LoopCloser::DeliverLate(const Odometry* odometry, std::int64_t frames) {
  const LateLoop late = *std::exchange(late_, std::nullopt);
  if (late.withdrawn) Withdraw(late.query, kTakenBack, odometry != nullptr);
  if (!late.accepted) return {};
  Withdraw(late.query, kDecidedLater, odometry != nullptr);  // if it waits as a witness
  return Decide(Proposed(late), late.verification, odometry, frames);
}

LoopCloser::Update LoopCloser::Decide(Loop proposed, const Verification& verification,
                                      const Odometry* odometry, std::int64_t frames) {
  if (odometry != nullptr) {
    const int candidate = KeyframeOf(proposed.candidate), query = KeyframeOf(proposed.query);
    if (candidate >= 0 && query >= 0)
      return Consider(std::move(proposed), verification, candidate, query, *odometry, frames);
    proposed.verified = false;  // of a detector whose file was changed
    proposed.reason = "the map has no keyframe of it";
  }
  if (proposed.verified) proposed.state = LoopState::kInMap;
  loops_.push_back(std::move(proposed));
  return {};
}

Loop LoopCloser::Proposed(std::int64_t query, std::int64_t candidate,
                          const Verification& verification) const {
  const auto stamp = [&](std::int64_t frame) { return stamps_.count(frame) != 0 ? stamps_.at(frame) : 0.0; };
  Loop loop;
  loop.query = query;
  loop.candidate = candidate;
  loop.query_stamp_s = stamp(query);
  loop.candidate_stamp_s = stamp(candidate);
  loop.matches = verification.matches;
  loop.inliers = verification.inliers;
  return loop;
}

Loop LoopCloser::Proposed(const LoopResult& r) const {
  Loop loop = Proposed(r.query, r.candidate, r.verification);
  loop.members = r.members;
  loop.hypothesis = r.hypothesis;
  loop.posterior = r.posterior;
  loop.probability = r.probability;
  loop.verified = r.accepted && GivesConstraint(r.verification);
  loop.reason = r.reason.empty() && !loop.verified ? r.verification.reason : r.reason;
  return loop;
}

Loop LoopCloser::Proposed(const LateLoop& late) const {
  Loop loop = Proposed(late.query, late.verification.candidate, late.verification);
  loop.probability = late.probability;
  loop.verified = late.accepted && GivesConstraint(late.verification);
  if (!loop.verified) loop.reason = late.verification.reason;
  return loop;
}

std::size_t LoopCloser::Prune(Odometry* odometry) {
  const Map before = odometry->map();
  const FrameView last = odometry->LastView();
  const std::size_t least_views = rig_.sensor == Sensor::kMono ? 2 : 1;  // that tell where a landmark is
  // The detector forgets what a keyframe looks like; its place is that of `into`.
  const auto may = [&](int keyframe, int into) {
    const std::int64_t frame = before.keyframe(keyframe).frame_index;
    if (!worker_ || keyframe_of_frame_.count(frame) == 0) return true;  // it never knew that image
    return worker_->Detector().Merge(frame, before.keyframe(into).frame_index);
  };
  Map map = before;
  FuseAll(rig_.camera, &map);
  const std::map<int, int> removed =
      tutti::Prune({last.keyframe, last.newest_keyframe}, least_views, may, &map);
  map.Compact();
  odometry->Replace(std::move(map));
  for (auto& [frame, keyframe] : keyframe_of_frame_) {
    for (auto next = removed.find(keyframe); next != removed.end(); next = removed.find(keyframe))
      keyframe = next->second;
  }
  graph_.Update(KeyframesOf(before), Covisible(before));
  for (std::size_t i = 0; i < loops_.size(); ++i) {
    Loop& loop = loops_[i];
    if (loop.state == LoopState::kRejected || graph_.Rehang(removed, &loop.edge)) continue;
    loop.untied = false;  // its two ends are one keyframe
  }
  graph_.Remove(removed);
  return removed.size();
}

SlamReport LoopCloser::Report() const {
  SlamReport report;
  report.corrections = corrections_;
  report.global_adjustments = adjustments_;
  const FollowedOdometry::Sigmas stated = followed_.Stated(), seen = followed_.Seen();
  report.followed = {stated.fraction, stated.rotation_rad, seen.fraction, seen.rotation_rad,
                     followed_.jumps()};
  report.graph_proof = proof_;
  report.stage_ms = stages_;
  if (worker_) report.stage_ms["loop_wait"] = worker_->WaitedMs() - waited_before_;
  return report;
}

std::vector<std::string> LoopCloser::TakeWarnings() {
  constexpr std::size_t kMostOfAKind = 5;
  const std::vector<OdometryJump>& jumps = followed_.jumps();
  for (; jumps_told_ < jumps.size(); ++jumps_told_) {
    if (jumps_told_ < kMostOfAKind) warnings_.push_back(Sentence(jumps[jumps_told_]));
    if (jumps_told_ == kMostOfAKind) warnings_.emplace_back("the odometry jumps more often");
  }
  return std::exchange(warnings_, {});
}

}  // namespace tutti
