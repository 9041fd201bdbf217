#include "tutti/pipeline/slam_system.h"

#include <algorithm>
#include <chrono>
#include <deque>
#include <iterator>
#include <utility>

#include "false_loop_source.h"
#include "global_adjuster.h"
#include "loop_constraint.h"
#include "loop_gate.h"
#include "loop_worker.h"
#include "map_graph.h"

namespace tutti {
namespace {

double MillisecondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
}

LoopDetectorOptions DetectorOptions(const RunConfig& config) {
  LoopDetectorOptions options = config.loops;
  options.threads = std::min(options.threads, config.run.threads);
  return options;
}

}  // namespace

class SlamSystem::Impl {
 public:
  Impl(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder)
      : recorder_(recorder),
        options_(config.run),
        rig_(rig),
        seed_(config.loops.seed),
        gate_(config.run),
        graph_(config.graph, config.run, rig.sensor),
        false_loops_(config.run, config.loops.seed) {
    if (rig.calibrated) {
      odometry_.emplace(config.odometry, rig);
      odometry_->SetRecorder(recorder);
      odometry_->UseOwnThreads(config.run.threads > 1);
    }
    if (config.run.loops)
      worker_ = std::make_unique<LoopWorker>(DetectorOptions(config), config.run.threads > 1, recorder);
  }

  void TakeOver(const Odometry& tracked, const std::map<int, KeyframeView>& views) {
    odometry_ = tracked;
    views_ = &views;
    for (const int id : odometry_->KeyframeIds()) graph_.AddKeyframe(id, odometry_->KeyframePiece(id));
  }

  void Replay(const InputFrame& frame, int keyframe, std::int64_t frames) {
    frames_ = frames - 1;
    DeliverDue();
    ++frames_;
    last_frame_ = frame.index;
    if (worker_) Submit(frame, keyframe);
  }

  TrackResult Track(const InputFrame& frame) {
    DeliverDue();
    ++frames_;
    TrackResult result;
    if (odometry_) {
      result = odometry_->Track(frame);
      last_frame_ = frame.index;
      if (worker_ && result.state != TrackingState::kTracking) result = Relocalize(frame, result);
      if (result.keyframe >= 0) {
        graph_.AddKeyframe(result.keyframe, odometry_->KeyframePiece(result.keyframe));
        frame_of_keyframe_[result.keyframe] = frame.index;
        frame_stamps_[frame.index] = frame.stamp_s;
        constexpr std::size_t kEveryKeyframes = 3;
        if (frame_of_keyframe_.size() % kEveryKeyframes == 0) Inject(result.keyframe);
      }
    } else {
      result.reason = "no calibration";
    }
    if (!worker_ && !on_keyframe_) return result;
    if (result.keyframe >= 0) unmapped_[result.keyframe] = frame;
    if (!odometry_ && worker_) Submit(frame, -1);
    SubmitMapped();
    return result;
  }

  void Finish() {
    if (odometry_) odometry_->FinishMapping();
    if (worker_ || on_keyframe_) SubmitMapped();
    while (!submitted_.empty()) Deliver();
    if (!deferred_.empty()) Close(std::exchange(deferred_, {}));
    while (odometry_ && Inject(-1)) {
    }
    if (adjuster_.Running()) EnterAdjustment();
    for (LoopRecord& record : records_) {
      if (!record.pending) continue;
      record.pending = false;
      record.reason = "no second loop nearby agreed with it";
    }
  }

  // ---- what SlamSystem hands out
  std::optional<Odometry> odometry_, untouched_;
  std::vector<std::string> warnings_;  // not taken yet
  std::int64_t untouched_last_ = -1;
  std::function<void(const LoopResult&)> on_detection_;      // may be empty
  std::function<void(const InputFrame&, int)> on_keyframe_;  // may be empty
  std::vector<LoopRecord> records_;
  int corrections_ = 0;
  int adjustments_ = 0;          // of the whole map
  std::size_t relocalized_ = 0;  // frames that were lost, and found by the detector

  PoseGraph Graph() const { return odometry_ ? graph_.Build(*odometry_, gate_.accepted()) : PoseGraph(); }

  std::map<std::string, double> StageMilliseconds() const {
    std::map<std::string, double> stages = stages_;
    if (odometry_) {
      for (const auto& [name, ms] : odometry_->StageMilliseconds()) stages["odometry_" + name] = ms;
    }
    if (worker_) stages["loop_wait"] = worker_->WaitedMs();
    return stages;
  }

 private:
  struct Submission {
    std::int64_t due = 0;  // number of frames after which its result enters
    std::int64_t frame = 0;
  };

  // Brings in what is due by now.
  void DeliverDue() {
    while (!submitted_.empty() && submitted_.front().due <= frames_) Deliver();
    if (adjuster_.Due(frames_)) EnterAdjustment();
  }

  // As the keyframe was when it was new.
  KeyframeView ViewOf(int keyframe) const {
    return views_ != nullptr ? views_->at(keyframe) : odometry_->Keyframe(keyframe);
  }

  // Before the detector changes anything: what the odometry alone would have done starts here.
  void KeepUntouched() {
    if (untouched_) return;
    untouched_ = *odometry_;
    untouched_last_ = last_frame_;
  }

  // A frame without a pose is looked up among the keyframes that the detector knows.
  TrackResult Relocalize(const InputFrame& frame, const TrackResult& lost) {
    constexpr int kFewFeatures = 100;  // nothing can be recognised by so few
    if (keyframe_of_frame_.empty() || lost.features < kFewFeatures) return lost;
    const auto begin = std::chrono::steady_clock::now();
    LoopQuery query;
    query.id = frame.index;
    query.image = frame.image;
    query.depth_m = frame.depth_m;
    query.camera = rig_.camera;
    const LoopResult found = worker_->Locate(query);
    const auto keyframe = keyframe_of_frame_.find(found.verification.candidate);
    TrackResult result = lost;
    if (found.accepted && keyframe != keyframe_of_frame_.end()) {
      KeepUntouched();
      result = odometry_->RelocalizeAt(keyframe->second);
    }
    if (result.state == TrackingState::kTracking) ++relocalized_;
    stages_["relocalize"] += MillisecondsSince(begin);
    return result;
  }

  // The detector gets a keyframe once all its landmarks are known.
  void SubmitMapped() {
    if (!odometry_) return;
    for (const int keyframe : odometry_->TakeMapped()) {
      const auto frame = unmapped_.find(keyframe);
      if (frame == unmapped_.end()) continue;
      if (on_keyframe_) on_keyframe_(frame->second, keyframe);
      if (worker_) Submit(frame->second, keyframe);
      unmapped_.erase(frame);
    }
  }

  void Submit(const InputFrame& frame, int keyframe) {
    if (keyframes_seen_++ % options_.loop_every_keyframes != 0) return;
    if (!stamps_.empty() && frame.stamp_s - stamps_.rbegin()->second < options_.loop_min_interval_s) return;
    LoopQuery query;
    query.id = frame.index;
    query.stamp_s = frame.stamp_s;
    query.image = frame.image;
    query.depth_m = frame.depth_m;
    if (odometry_) {
      KeyframeView view = ViewOf(keyframe);
      query.camera = rig_.camera;
      query.features = {std::move(view.keypoints), std::move(view.descriptors), std::move(view.points)};
      keyframe_of_frame_[frame.index] = keyframe;
    }
    stamps_[frame.index] = frame.stamp_s;
    submitted_.push_back({frames_ + options_.loop_delay_frames, frame.index});
    const auto begin = std::chrono::steady_clock::now();
    worker_->Submit(std::move(query));
    if (options_.threads == 1) stages_["loop_inline"] += MillisecondsSince(begin);
  }

  static LoopRecord Record(const LoopResult& r) {
    LoopRecord record;
    record.query = r.query;
    record.candidate = r.verification.candidate >= 0 ? r.verification.candidate : r.candidate;
    record.members = r.members;
    record.hypothesis = r.hypothesis;
    record.posterior = r.posterior;
    record.matches = r.verification.matches;
    record.inliers = r.verification.inliers;
    record.verified = r.accepted;
    record.reason = r.reason.empty() && !r.accepted ? r.verification.reason : r.reason;
    return record;
  }

  // Takes the oldest result.
  void Deliver() {
    submitted_.pop_front();
    const LoopResult result = worker_->Take();
    if (on_detection_) on_detection_(result);
    for (const auto& [name, ms] : LoopStages(result)) stages_[std::string("loop_") + name] += ms;
    if (!result.warning.empty() && result.warning != loop_warning_) {
      loop_warning_ = result.warning;
      warnings_.push_back(result.warning);
    }
    if (!result.proposed) return;
    LoopRecord record = Record(result);
    const auto stamp = [&](std::int64_t frame) {
      return stamps_.count(frame) != 0 ? stamps_.at(frame) : 0.0;
    };
    record.query_stamp_s = stamp(record.query);
    record.candidate_stamp_s = stamp(record.candidate);
    records_.push_back(record);
    if (!result.accepted) return;
    if (!odometry_) {
      records_.back().accepted = true;
    } else {
      Consider(result);
    }
  }

  LoopGate::Map Places() const {
    const std::vector<int> ids = odometry_->KeyframeIds();
    return [this, ids](int id) {
      LoopGate::Place place;
      place.alive = std::binary_search(ids.begin(), ids.end(), id);
      if (!place.alive) return place;
      place.piece = odometry_->KeyframePiece(id);
      place.T_world_camera = odometry_->KeyframePose(id);
      return place;
    };
  }

  // A verified loop: measure it against the map, and close it if something else says the same.
  void Consider(const LoopResult& result) {
    odometry_->FinishMapping();
    LoopRecord& record = records_.back();
    const auto candidate = keyframe_of_frame_.find(record.candidate),
               query = keyframe_of_frame_.find(record.query);
    const std::vector<int> ids = odometry_->KeyframeIds();
    if (candidate == keyframe_of_frame_.end() || query == keyframe_of_frame_.end() ||
        !std::binary_search(ids.begin(), ids.end(), candidate->second) ||
        !std::binary_search(ids.begin(), ids.end(), query->second)) {
      record.reason = "one of its keyframes is no longer in the map";
      return;
    }
    if (record.query_stamp_s - record.candidate_stamp_s < options_.loop_min_age_s) {
      record.reason = "too recent: still in the local map";
      return;
    }
    LoopConstraint constraint =
        MakeLoopConstraint(result.verification, odometry_->Keyframe(candidate->second),
                           odometry_->Keyframe(query->second), rig_, options_, seed_);
    if (!constraint.usable) {
      record.reason = constraint.reason;
      return;
    }
    constraint.edge.record = records_.size() - 1;
    record.S_candidate_query = constraint.edge.S_candidate_query;
    record.has_scale = true;
    const LoopGate::Map places = Places();
    std::vector<LoopEdge> entering = gate_.Offer(constraint.edge, places);
    if (entering.empty()) {
      record.pending = true;
      record.reason = "waits for a second loop that agrees";
      return;
    }
    entering.insert(entering.begin(), deferred_.begin(), deferred_.end());
    deferred_.clear();
    const auto fulfilled = [&](const LoopEdge& loop) { return gate_.Fulfilled(loop, places); };
    if (std::all_of(entering.begin(), entering.end(), fulfilled)) {
      deferred_ = std::move(entering);
      if (options_.global_adjustment) Fuse(deferred_);
    } else {
      Close(std::move(entering));
    }
  }

  // A false loop, past detector and gate: what the pose graph makes of it. False if there is none to make.
  bool Inject(int keyframe) {
    std::optional<LoopEdge> loop = false_loops_.Next(*odometry_, frame_of_keyframe_, keyframe);
    if (!loop) return false;
    LoopRecord record;
    record.query = loop->query_frame;
    record.candidate = loop->candidate_frame;
    record.query_stamp_s = frame_stamps_.at(record.query);
    record.candidate_stamp_s = frame_stamps_.at(record.candidate);
    record.verified = record.injected = record.has_scale = true;
    record.S_candidate_query = loop->S_candidate_query;
    loop->record = records_.size();
    records_.push_back(record);
    Close({*loop});
    return true;
  }

  // Loops that the map can't have drifted to by what it knows of its own uncertainty.
  void Gate(std::vector<LoopEdge>& entering) {
    if (options_.loop_gate_sigmas == 0) return;
    std::vector<LoopEdge> passed;
    for (const LoopEdge& loop : entering) {
      const std::optional<double> distance = graph_.Distance(*odometry_, gate_.accepted(), loop);
      if (!distance || *distance <= options_.loop_gate_sigmas) {
        passed.push_back(loop);
        continue;
      }
      char text[120];
      std::snprintf(text, sizeof text, "the map can't be that far off: Mahalanobis distance %.1f, limit %.1f",
                    *distance, options_.loop_gate_sigmas);
      Reject(loop, text);
    }
    entering = std::move(passed);
  }

  bool Contradicts(const Disagreement& d) const {
    return d.fraction > options_.loop_after_fraction || d.angle_deg > options_.loop_after_deg;
  }

  void Reject(const LoopEdge& loop, const std::string& reason) {
    records_[loop.record].pending = false;
    records_[loop.record].reason = reason;
  }

  // Optimises with the entering loops; those that the rest contradicts leave again. Then the map moves.
  void Close(std::vector<LoopEdge> entering) {
    const ScopedSpan span(recorder_, Lane::kOptimisation, "close_loop");
    const auto begin = std::chrono::steady_clock::now();
    odometry_->FinishMapping();
    MapGraph::Correction correction;
    Gate(entering);
    while (!entering.empty()) {
      std::vector<LoopEdge> loops = gate_.accepted();
      loops.insert(loops.end(), entering.begin(), entering.end());
      correction = graph_.Optimize(*odometry_, loops);
      if (!correction.success) {
        for (const LoopEdge& loop : entering)
          Reject(loop, "the pose graph could not be solved: " + correction.reason);
        entering.clear();
        break;
      }
      const std::size_t old = gate_.accepted().size();
      bool old_broken = false;
      for (std::size_t i = 0; i < old; ++i) old_broken = old_broken || Contradicts(correction.residuals[i]);
      std::vector<LoopEdge> staying;
      for (std::size_t i = 0; i < entering.size(); ++i) {
        const Disagreement& d = correction.residuals[old + i];
        records_[entering[i].record].weight = correction.weights[old + i];
        if (!old_broken && !Contradicts(d)) {
          staying.push_back(entering[i]);
          continue;
        }
        char text[160];
        std::snprintf(
            text, sizeof text,
            "contradicts the map: off by %.0f %% of the scene depth and %.1f deg after optimisation",
            100 * d.fraction, d.angle_deg);
        Reject(entering[i], old_broken ? "contradicts loops that were accepted before" : text);
      }
      if (staying.size() == entering.size()) break;
      entering = std::move(staying);
    }
    if (!entering.empty()) Apply(correction, entering);
    stages_["loop_optimize"] += MillisecondsSince(begin);
  }

  void Apply(const MapGraph::Correction& correction, const std::vector<LoopEdge>& entering) {
    for (const LoopEdge& loop : entering) {
      LoopRecord& record = records_[loop.record];
      record.accepted = true;
      record.pending = false;
      record.reason.clear();
      gate_.Accepted(loop);
    }
    for (std::size_t i = 0; i < gate_.accepted().size(); ++i)
      records_[gate_.accepted()[i].record].weight = correction.weights[i];
    KeepUntouched();
    graph_.Keep(*odometry_, correction, gate_.accepted(), gate_.waiting());
    odometry_->ApplyCorrection(correction.S_world_keyframe, correction.merges);
    ++corrections_;
    if (options_.global_adjustment && Fuse(entering))
      adjuster_.MapMoved(*odometry_, odometry_->KeyframePiece(entering.back().candidate), frames_);
  }

  // Landmarks that both ends of a loop see become one. False if some loop has too few of them: to adjust the
  // map without it would open it again.
  bool Fuse(const std::vector<LoopEdge>& loops) {
    constexpr int kLeastCommon = 30;
    for (const LoopEdge& loop : loops) untied_[loop.record] = loop;
    for (auto untied = untied_.begin(); untied != untied_.end();) {
      const LoopEdge& loop = untied->second;
      const int common = odometry_->FuseLoop(loop.candidate, loop.query, loop.S_candidate_query);
      untied = common >= kLeastCommon ? untied_.erase(untied) : std::next(untied);
    }
    return untied_.empty();
  }

  // Brings in what the adjustment of the whole map has found.
  void EnterAdjustment() {
    const ScopedSpan span(recorder_, Lane::kOptimisation, "enter_adjustment");
    const auto begin = std::chrono::steady_clock::now();
    odometry_->FinishMapping();
    const GlobalAdjustment adjustment = adjuster_.Take();
    MapGraph::Correction correction;
    if (auto moved = odometry_->CorrectionOf(adjustment)) {
      correction.S_world_keyframe = std::move(*moved);
      graph_.Keep(*odometry_, correction, gate_.accepted(), gate_.waiting());
      odometry_->Enter(adjustment, correction.S_world_keyframe);
      graph_.MeasureAgain(*odometry_, gate_.accepted());
      ++adjustments_;
    }
    stages_["global_adjustment"] += MillisecondsSince(begin);
  }

  const std::map<int, KeyframeView>* views_ = nullptr;  // of a complete odometry
  SpanRecorder* recorder_;
  SlamOptions options_;
  CameraRig rig_;
  std::uint64_t seed_ = 1;
  LoopGate gate_;
  MapGraph graph_;
  FalseLoopSource false_loops_;
  std::map<int, std::int64_t> frame_of_keyframe_;
  std::map<std::int64_t, double> frame_stamps_;  // of the keyframes' frames
  std::unique_ptr<LoopWorker> worker_;
  std::string loop_warning_;  // the last one
  GlobalAdjuster adjuster_;
  std::map<std::size_t, LoopEdge> untied_;  // loops that landmarks do not hold together yet, by record
  std::deque<Submission> submitted_;
  std::vector<LoopEdge> deferred_;  // agreed, and the map fulfils them: they enter with the next correction
  std::map<std::int64_t, int> keyframe_of_frame_;  // of the frames that the detector knows
  std::map<std::int64_t, double> stamps_;          // the same
  std::map<int, InputFrame> unmapped_;             // keyframes that the detector waits for
  std::int64_t frames_ = 0;
  std::int64_t last_frame_ = -1;  // index of the last one that the odometry has seen
  std::int64_t keyframes_seen_ = 0;
  std::map<std::string, double> stages_;
};

SlamSystem::SlamSystem(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder)
    : impl_(std::make_unique<Impl>(config, rig, recorder)) {}
void SlamSystem::SetKeyframeListener(std::function<void(const InputFrame&, int)> listener) {
  impl_->on_keyframe_ = std::move(listener);
}

SlamSystem::SlamSystem(const RunConfig& config, const CameraRig& rig, const Odometry& tracked,
                       const std::map<int, KeyframeView>& views)
    : impl_(std::make_unique<Impl>(config, rig, nullptr)) {
  impl_->TakeOver(tracked, views);
}
SlamSystem::~SlamSystem() = default;

void SlamSystem::SetDetectionListener(std::function<void(const LoopResult&)> listener) {
  impl_->on_detection_ = std::move(listener);
}

TrackResult SlamSystem::Track(const InputFrame& frame) { return impl_->Track(frame); }
void SlamSystem::Replay(const InputFrame& frame, int keyframe, std::int64_t frames) {
  impl_->Replay(frame, keyframe, frames);
}
void SlamSystem::Finish() { impl_->Finish(); }
bool SlamSystem::AppearanceOnly() const { return !impl_->odometry_; }
const Odometry* SlamSystem::odometry() const { return impl_->odometry_ ? &*impl_->odometry_ : nullptr; }
Odometry* SlamSystem::untouched() { return impl_->untouched_ ? &*impl_->untouched_ : nullptr; }
std::int64_t SlamSystem::UntouchedLast() const { return impl_->untouched_last_; }
std::vector<std::string> SlamSystem::TakeWarnings() { return std::exchange(impl_->warnings_, {}); }
const std::vector<LoopRecord>& SlamSystem::loops() const { return impl_->records_; }
std::size_t SlamSystem::Relocalized() const { return impl_->relocalized_; }
int SlamSystem::Corrections() const { return impl_->corrections_; }
int SlamSystem::GlobalAdjustments() const { return impl_->adjustments_; }
PoseGraph SlamSystem::Graph() const { return impl_->Graph(); }
std::map<std::string, double> SlamSystem::StageMilliseconds() const { return impl_->StageMilliseconds(); }

std::size_t SlamSystem::LoopsAccepted() const {
  std::size_t count = 0;
  for (const LoopRecord& record : impl_->records_) count += record.accepted ? 1 : 0;
  return count;
}

}  // namespace tutti
