#include "tutti/slam/slam_system.h"

#include <algorithm>
#include <deque>
#include <utility>

#include "apps/slam/loop_closer.h"
#include "apps/slam/loop_worker.h"
#include "core/stopwatch.h"

namespace tutti {
namespace {

LoopDetectorOptions DetectorOptions(const RunConfig& config) {
  LoopDetectorOptions options = config.loops;
  options.threads = std::min(options.threads, config.run.threads);
  return options;
}

}  // namespace

class SlamSystem::Impl {
 public:
  Impl(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder)
      : recorder_(recorder), options_(config.run), rig_(rig) {
    if (rig.calibrated) {
      odometry_.emplace(config.odometry, rig);
      odometry_->SetRecorder(recorder);
      odometry_->UseOwnThreads(config.run.threads > 1);
      closer_.emplace(config, rig, recorder, &*odometry_, &records_, [this] { KeepUntouched(); });
    }
    if (config.run.loops)
      worker_ = std::make_unique<LoopWorker>(DetectorOptions(config), config.run.threads > 1, recorder);
  }

  void TakeOver(const Odometry& tracked, const std::map<int, KeyframeView>& views) {
    odometry_ = tracked;
    views_ = &views;
    closer_->AddKeyframes();
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
        closer_->AddKeyframes();
        constexpr int kEveryKeyframes = 3;
        if (++keyframes_made_ % kEveryKeyframes == 0) closer_->Inject(result.keyframe, frames_);
        TellRevoked();
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
    if (closer_) closer_->Finish(frames_);
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
  std::optional<LoopCloser> closer_;  // if there is an odometry
  std::size_t relocalized_ = 0;       // frames that were lost, and found by the detector

  PoseGraph Graph() const { return closer_ ? closer_->Graph() : PoseGraph(); }

  std::map<std::string, double> StageMilliseconds() const {
    std::map<std::string, double> stages = stages_;
    if (odometry_) {
      for (const auto& [name, ms] : odometry_->StageMilliseconds()) stages["odometry_" + name] = ms;
      for (const auto& [name, ms] : closer_->StageMilliseconds()) stages[name] = ms;
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
    if (closer_) closer_->EnterDue(frames_);
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
    const internal::Stopwatch watch;
    LoopQuery query;
    query.id = frame.index;
    query.image = frame.image;
    query.depth_m = frame.depth_m;
    query.camera = rig_.camera;
    const LoopResult found = worker_->Locate(query);
    const int keyframe = KeyframeOf(found.candidate);
    TrackResult result = lost;
    if (found.accepted && keyframe >= 0) {
      KeepUntouched();
      result = odometry_->RelocalizeAt(keyframe);
    }
    if (result.state == TrackingState::kTracking) ++relocalized_;
    stages_["relocalize"] += watch.Milliseconds();
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
      if (options_.loop_pose_prior && rig_.sensor != Sensor::kMono) {  // mono: its scale drifts
        query.pose_prior.emplace();
        query.pose_prior->position_m = view.T_world_camera.translation;
        query.pose_prior->frame = view.map_piece;
      }
      query.features = {std::move(view.keypoints), std::move(view.descriptors), std::move(view.points)};
      keyframe_of_frame_[frame.index] = keyframe;
    }
    stamps_[frame.index] = frame.stamp_s;
    submitted_.push_back({frames_ + options_.loop_delay_frames, frame.index});
    const internal::Stopwatch watch;
    worker_->Submit(std::move(query));
    if (options_.threads == 1) stages_["loop_inline"] += watch.Milliseconds();
  }

  static LoopRecord Record(const LoopResult& r) {
    LoopRecord record;
    record.query = r.query;
    record.candidate = r.candidate;
    record.members = r.members;
    record.hypothesis = r.hypothesis;
    record.posterior = r.posterior;
    record.probability = r.probability;
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
      closer_->Consider(result.verification, KeyframeOf(record.candidate), KeyframeOf(record.query), frames_);
      TellRevoked();
    }
  }

  // What the map contradicts is no loop for the detector's filter either.
  void TellRevoked() {
    for (const auto& [query, candidate] : closer_->TakeRevoked()) {
      if (worker_) worker_->Unlink(query, candidate);
    }
  }

  // -1 if the detector does not know the frame.
  int KeyframeOf(std::int64_t frame) const {
    const auto keyframe = keyframe_of_frame_.find(frame);
    return keyframe != keyframe_of_frame_.end() ? keyframe->second : -1;
  }

  const std::map<int, KeyframeView>* views_ = nullptr;  // of a complete odometry
  SpanRecorder* recorder_;
  SlamOptions options_;
  CameraRig rig_;
  std::unique_ptr<LoopWorker> worker_;
  std::string loop_warning_;  // the last one
  std::deque<Submission> submitted_;
  std::map<std::int64_t, int> keyframe_of_frame_;  // of the frames that the detector knows
  std::map<std::int64_t, double> stamps_;          // the same
  std::map<int, InputFrame> unmapped_;             // keyframes that the detector waits for
  std::int64_t frames_ = 0;
  std::int64_t last_frame_ = -1;     // index of the last one that the odometry has seen
  std::int64_t keyframes_seen_ = 0;  // by the detector
  int keyframes_made_ = 0;           // by the odometry
  std::map<std::string, double> stages_;
};

SlamSystem::SlamSystem(const RunConfig& config, const CameraRig& rig, SpanRecorder* recorder)
    : impl_(std::make_unique<Impl>(config, rig, recorder)) {}
SlamSystem::SlamSystem(const RunConfig& config, const CameraRig& rig, const Odometry& tracked,
                       const std::map<int, KeyframeView>& views)
    : impl_(std::make_unique<Impl>(config, rig, nullptr)) {
  impl_->TakeOver(tracked, views);
}
SlamSystem::~SlamSystem() = default;

void SlamSystem::SetKeyframeListener(std::function<void(const InputFrame&, int)> listener) {
  impl_->on_keyframe_ = std::move(listener);
}
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
int SlamSystem::Corrections() const { return impl_->closer_ ? impl_->closer_->Corrections() : 0; }
int SlamSystem::GlobalAdjustments() const { return impl_->closer_ ? impl_->closer_->Adjustments() : 0; }
PoseGraph SlamSystem::Graph() const { return impl_->Graph(); }
std::map<std::string, double> SlamSystem::StageMilliseconds() const { return impl_->StageMilliseconds(); }

std::size_t SlamSystem::LoopsAccepted() const {
  std::size_t count = 0;
  for (const LoopRecord& record : impl_->records_) count += record.accepted ? 1 : 0;
  return count;
}

}  // namespace tutti
