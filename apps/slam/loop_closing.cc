#include "apps/slam/loop_closing.h"

#include <algorithm>
#include <utility>

#include "apps/slam/map_parts.h"
#include "apps/slam/map_state.h"
#include "apps/slam/odometry_jumps.h"
#include "core/section_file.h"
#include "core/stopwatch.h"

namespace tutti {
namespace {

LoopDetectorOptions DetectorOptions(const RunConfig& config) {
  LoopDetectorOptions options = config.loops;
  options.threads = std::min(options.threads, config.run.threads);
  return options;
}

// One camera's landmarks have a scale of their own, which drifts: no metre is to be read from them.
bool IsMetric(const CameraRig& rig) { return rig.sensor != Sensor::kMono; }

// A place may be certain where the motion is not. Without a camera there is none, and the place is all.
bool GivesConstraint(const Verification& v) {
  return v.accepted || v.type == ConstraintType::kFundamental || v.type == ConstraintType::kNone;
}

LoopQuery Query(const InputFrame& frame, const CameraRig& rig) {
  LoopQuery query;
  query.metric = IsMetric(rig);
  query.id = frame.index;
  query.stamp_s = frame.stamp_s;
  query.image = frame.image;
  query.depth_m = frame.depth_m;
  query.mask = frame.mask;
  return query;
}

}  // namespace

LoopClosing::LoopClosing(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder, bool resumes)
    : options_(config.run), rig_(rig), closer_(config, rig, recorder) {
  if (!config.run.loops) return;
  worker_ = std::make_unique<LoopWorker>(DetectorOptions(config), config.run.threads > 1, recorder, resumes);
}

std::shared_future<std::shared_ptr<const LoopWorker::Saved>> LoopClosing::SaveDetector() const {
  return worker_ ? worker_->Save() : std::shared_future<std::shared_ptr<const LoopWorker::Saved>>();
}

void LoopClosing::SetDetectionListener(std::function<void(const LoopResult&)> listener) {
  on_detection_ = std::move(listener);
}

void LoopClosing::BeginSession(const CameraRig& rig, std::int64_t first_frame, int first_keyframe) {
  rig_ = rig;
  session_ = first_frame;
  keyframes_seen_ = 0;
  stages_.clear();
  closer_.BeginSession(rig, first_frame, first_keyframe);
  if (worker_) worker_->BeginSession();
}

void LoopClosing::Submit(const InputFrame& frame, const KeyframeView* view, std::int64_t frames) {
  if (keyframes_seen_++ % options_.loop_every_keyframes != 0) return;
  const bool first = stamps_.empty() || stamps_.rbegin()->first < session_;
  if (!first && frame.stamp_s - stamps_.rbegin()->second < options_.loop_min_interval_s) return;
  Ask(Query(frame, rig_), view, frames);
}

std::vector<ProposedLoop> LoopClosing::Compare(
    std::vector<LoopPlace> places, std::int64_t first_frame,
    const std::function<std::optional<KeyframeView>(std::int64_t frame)>& view) {
  worker_->BeginSession();
  std::vector<ProposedLoop> loops;
  const auto propose = [&](LoopRecord record, const Verification& verification) {
    if (record.candidate >= first_frame) return;  // loops within the other map are known
    const int candidate = KeyframeOf(record.candidate), query = KeyframeOf(record.query);
    if (candidate < 0 || query < 0) return;  // of a detector whose file was changed
    loops.push_back({std::move(record), verification, candidate, query});
  };
  const auto take = [&] {
    const LoopResult result = TakeResult();
    if (result.late) {
      for (ProposedLoop& loop : loops) {
        if (loop.record.query != result.late->query || !result.late->withdrawn) continue;
        loop.record.verified = false;
        loop.record.reason = kTakenBack;
      }
      if (result.late->accepted) propose(Record(*result.late), result.late->verification);
    }
    if (result.proposed) propose(Record(result), result.verification);
  };
  for (LoopPlace& place : places) {
    const std::optional<KeyframeView> of = view(place.id);
    if (!of) continue;
    LoopQuery query;
    query.metric = IsMetric(rig_);
    query.id = first_frame + place.id;
    query.stamp_s = of->stamp_s;
    query.member_features = std::move(place.member_features);
    if (place.camera) {  // an earlier session's may be another one than that of the keyframes' pixels
      const PinholeCamera &from = *place.camera, &to = rig_.camera;
      for (auto& [name, features] : query.member_features) {
        for (cv::KeyPoint& k : features.keypoints) {
          k.pt.x = static_cast<float>((double(k.pt.x) - from.cx) / from.fx * to.fx + to.cx);
          k.pt.y = static_cast<float>((double(k.pt.y) - from.cy) / from.fy * to.fy + to.cy);
        }
      }
    }
    Ask(std::move(query), &*of, 0);
    while (submitted_.size() > static_cast<std::size_t>(options_.loop_delay_frames)) take();
  }
  while (!submitted_.empty()) take();
  return loops;
}

std::string LoopClosing::Join(const std::vector<ProposedLoop>& loops, const Odometry& odometry,
                              std::int64_t frames) {
  LoopUpdate update;
  std::string reason = closer_.Join(loops, odometry, frames, &update);
  TellRevoked(update);
  return reason;
}

LoopUpdate LoopClosing::MoveAll(const std::map<int, Similarity>& S_world_keyframe, const Odometry& odometry) {
  if (worker_) worker_->ForgetPositions();
  return closer_.MoveAll(S_world_keyframe, odometry);
}

void LoopClosing::Ask(LoopQuery query, const KeyframeView* view, std::int64_t frames) {
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

int LoopClosing::Locate(const InputFrame& frame) {
  if (!worker_ || keyframe_of_frame_.empty()) return -1;
  LoopQuery query = Query(frame, rig_);
  query.camera = rig_.camera;
  const LoopResult found = worker_->Locate(query);
  return found.accepted ? KeyframeOf(found.candidate) : -1;
}

std::optional<LoopUpdate> LoopClosing::Due(const Odometry* odometry, std::int64_t frames) {
  std::optional<LoopUpdate> update;
  if (odometry != nullptr) update = closer_.Solved(*odometry, frames);
  if (!update && late_) update = DeliverLate(odometry, frames);
  if (!update && !submitted_.empty() && submitted_.front().due <= frames) update = Deliver(odometry, frames);
  if (!update && odometry != nullptr) update = closer_.Adjusted(*odometry, frames);
  if (update) TellRevoked(*update);
  return update;
}

std::optional<LoopUpdate> LoopClosing::Rest(const Odometry* odometry, std::int64_t frames) {
  std::optional<LoopUpdate> update;
  if (odometry != nullptr) closer_.JudgeJumps(*odometry, true);
  if (odometry != nullptr) update = closer_.Solved(*odometry, frames, Entering::kAtOnce);
  if (!update && late_) update = DeliverLate(odometry, frames);
  if (!update && !submitted_.empty()) update = Deliver(odometry, frames);
  if (!update && odometry != nullptr && closer_.CloseDeferred(*odometry, frames)) update.emplace();
  if (!update && odometry != nullptr) update = closer_.Adjusted(*odometry, frames, Entering::kAtOnce);
  if (update) TellRevoked(*update);
  if (update) return update;
  closer_.Finish();
  const std::string uncertainty = closer_.followed().Warning();
  if (!uncertainty.empty()) warnings_.push_back(uncertainty);
  return update;
}

// What the map contradicts is no loop for the detector's filter either.
void LoopClosing::TellRevoked(const LoopUpdate& update) {
  for (const std::size_t record : update.revoked) {
    const LoopRecord& loop = closer_.records()[record];
    if (worker_) worker_->Unlink(loop.query, loop.candidate);
  }
}

LoopRecord LoopClosing::RecordOf(std::int64_t query, std::int64_t candidate,
                                 const Verification& verification) const {
  const auto stamp = [&](std::int64_t frame) { return stamps_.count(frame) != 0 ? stamps_.at(frame) : 0.0; };
  LoopRecord record;
  record.query = query;
  record.candidate = candidate;
  record.query_stamp_s = stamp(query);
  record.candidate_stamp_s = stamp(candidate);
  record.matches = verification.matches;
  record.inliers = verification.inliers;
  return record;
}

LoopRecord LoopClosing::Record(const LoopResult& r) const {
  LoopRecord record = RecordOf(r.query, r.candidate, r.verification);
  record.members = r.members;
  record.hypothesis = r.hypothesis;
  record.posterior = r.posterior;
  record.probability = r.probability;
  record.verified = r.accepted && GivesConstraint(r.verification);
  record.reason = r.reason.empty() && !record.verified ? r.verification.reason : r.reason;
  return record;
}

LoopRecord LoopClosing::Record(const LateLoop& late) const {
  LoopRecord record = RecordOf(late.query, late.verification.candidate, late.verification);
  record.probability = late.probability;
  record.verified = late.accepted && GivesConstraint(late.verification);
  if (!record.verified) record.reason = late.verification.reason;
  return record;
}

// The oldest answer.
LoopResult LoopClosing::TakeResult() {
  submitted_.pop_front();
  LoopResult result = worker_->Take();
  if (on_detection_) on_detection_(result);
  for (const auto& [name, ms] : LoopStages(result)) stages_[std::string("loop_") + name] += ms;
  if (!result.warning.empty() && result.warning != last_warning_) {
    last_warning_ = result.warning;
    warnings_.push_back(result.warning);
  }
  return result;
}

LoopUpdate LoopClosing::Deliver(const Odometry* odometry, std::int64_t frames) {
  const LoopResult result = TakeResult();
  late_ = result.late;
  if (!result.proposed) return {};
  return Decide(Record(result), result.verification, odometry, frames);
}

// What was said of an image comes with the answer to a later one: a fixed number of frames after it.
LoopUpdate LoopClosing::DeliverLate(const Odometry* odometry, std::int64_t frames) {
  const LateLoop late = *std::exchange(late_, std::nullopt);
  if (late.withdrawn) closer_.Withdraw(late.query, kTakenBack, odometry != nullptr);
  if (!late.accepted) return {};
  closer_.Withdraw(late.query, kDecidedLater, odometry != nullptr);  // if it waits as a witness
  return Decide(Record(late), late.verification, odometry, frames);
}

LoopUpdate LoopClosing::Decide(const LoopRecord& proposed, const Verification& verification,
                               const Odometry* odometry, std::int64_t frames) {
  LoopRecord record = proposed;
  if (odometry != nullptr) {
    const int candidate = KeyframeOf(record.candidate), query = KeyframeOf(record.query);
    if (candidate >= 0 && query >= 0)
      return closer_.Consider(record, verification, candidate, query, *odometry, frames);
    record.verified = false;  // of a detector whose file was changed
    record.reason = "the map has no keyframe of it";
  }
  record.accepted = record.verified;
  closer_.List(record);
  return {};
}

LoopUpdate LoopClosing::ConsiderFound(const Verification& found, int candidate, int query,
                                      const Odometry& odometry, std::int64_t frames) {
  LoopRecord record;
  record.query = odometry.map().keyframe(query).frame_index;
  record.candidate = odometry.map().keyframe(candidate).frame_index;
  record.query_stamp_s = odometry.map().keyframe(query).stamp_s;
  record.candidate_stamp_s = odometry.map().keyframe(candidate).stamp_s;
  record.matches = found.matches;
  record.inliers = found.inliers;
  record.verified = found.accepted;
  record.reason = found.reason;
  LoopUpdate update = closer_.Consider(record, found, candidate, query, odometry, frames, true);
  TellRevoked(update);
  return update;
}

void LoopClosing::Check(const Odometry* odometry, const internal::SectionReader& file) const {
  const int end = odometry != nullptr ? odometry->map().KeyframeCount() : 0;
  for (const auto& [frame, keyframe] : keyframe_of_frame_) internal::CheckIndex(keyframe, 0, end, file);
  closer_.Check(end, file);
}

void LoopClosing::ResumeDetector(internal::SectionReader* file) {
  file->SkipTo(MapSection::kDetector);
  LoopWorker::Saved saved;
  ReadState(*file, MapSection::kDetector, &saved);
  worker_->Resume(file, std::move(saved));
}

// -1 if the detector does not know the frame.
int LoopClosing::KeyframeOf(std::int64_t frame) const {
  const auto keyframe = keyframe_of_frame_.find(frame);
  return keyframe != keyframe_of_frame_.end() ? keyframe->second : -1;
}

bool LoopClosing::Forget(int keyframe, int into, const Odometry& odometry) {
  const std::int64_t frame = odometry.map().keyframe(keyframe).frame_index;
  if (!worker_ || keyframe_of_frame_.count(frame) == 0) return true;  // it never knew that image
  return worker_->Merge(frame, odometry.map().keyframe(into).frame_index);
}

void LoopClosing::Removed(const std::map<int, int>& into, const Odometry& before) {
  for (auto& [frame, keyframe] : keyframe_of_frame_) {
    for (auto next = into.find(keyframe); next != into.end(); next = into.find(keyframe))
      keyframe = next->second;
  }
  closer_.Removed(into, before);
}

std::vector<std::string> LoopClosing::TakeWarnings() {
  constexpr std::size_t kMostOfAKind = 5;
  const std::vector<OdometryJump>& jumps = closer_.followed().jumps();
  for (; jumps_told_ < jumps.size(); ++jumps_told_) {
    if (jumps_told_ < kMostOfAKind) warnings_.push_back(Sentence(jumps[jumps_told_]));
    if (jumps_told_ == kMostOfAKind) warnings_.emplace_back("the odometry jumps more often");
  }
  return std::exchange(warnings_, {});
}

std::map<std::string, double> LoopClosing::StageMilliseconds() const {
  std::map<std::string, double> stages = stages_;
  for (const auto& [name, ms] : closer_.StageMilliseconds()) stages[name] = ms;
  if (worker_) stages["loop_wait"] = worker_->WaitedMs();
  return stages;
}

}  // namespace tutti
