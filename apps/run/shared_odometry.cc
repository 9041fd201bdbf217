#include "apps/run/shared_odometry.h"

#include <opencv2/core.hpp>

#include "apps/run/interrupt.h"
#include "apps/run/live_files.h"
#include "apps/run/outputs.h"
#include "apps/run/progress.h"
#include "apps/run/run_parts.h"
#include "apps/slam/loop_closer.h"
#include "core/stopwatch.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

class SequenceRecorder : public RunObserver {
 public:
  explicit SequenceRecorder(TrackedSequence& sequence) : sequence_(sequence) {}
  void OnRestart() override {
    sequence_ = TrackedSequence();
    frames_ = 0;
  }
  void OnFrame(const InputFrame&, const TrackResult&, const RunState&) override { ++frames_; }
  void OnKeyframe(const InputFrame& frame, int keyframe, const RunState& state) override {
    // Called before the OnFrame of the frame that is being tracked.
    sequence_.keyframes.push_back({keyframe, frame.stamp_s, frames_ + 1});
    sequence_.views[keyframe] = ViewOf(state.odometry->map(), keyframe);
  }
  void OnEnd(const RunState& state) override {
    if (state.odometry != nullptr) sequence_.odometry = std::make_shared<const Odometry>(*state.odometry);
  }

 private:
  TrackedSequence& sequence_;
  std::int64_t frames_ = 0;
};

/// Loops on an odometry that is complete: they move it, but no tracking goes on from there.
class Replay {
 public:
  Replay(const RunConfig& config, const CameraRig& rig, const Odometry& tracked, LoopListener listener)
      : loops_(config, rig, nullptr, std::move(listener)), odometry_(tracked) {}

  const LoopCloser& loops() const { return loops_; }
  RunState State() const { return {&odometry_, loops_.loops(), loops_.Report().corrections}; }

  void Keyframe(const InputFrame& frame, const KeyframeView& view, std::int64_t frames) {
    frames_ = frames;
    loops_.Due(&odometry_, frames - 1);
    loops_.AddKeyframe(frame, &view, frames);
  }
  void Finish() { loops_.Finish(&odometry_, frames_); }

 private:
  LoopCloser loops_;
  Odometry odometry_;
  std::int64_t frames_ = 0;
};

void CloseAll(const TrackedSequence& tracked, const RunRequest& request, const Dataset& dataset,
              Replay& replay, LiveFiles& live, RunResult& result) {
  for (const auto& observer : request.observers) observer->OnStart(result.rig, tracked.keyframes.size());
  Progress progress("loops", tracked.keyframes.size(), request.quiet ? nullptr : internal::StandardError());
  for (std::size_t k = 0; k < tracked.keyframes.size() && !InterruptGuard::Requested(); ++k) {
    const TrackedSequence::Keyframe& keyframe = tracked.keyframes[k];
    const std::optional<std::size_t> place = FindStamp(dataset, keyframe.stamp_s);
    const ReadResult read = place ? dataset.Read(*place) : ReadResult{std::nullopt, "it is gone", {}};
    if (!read.frame) {
      throw InputError("the frame at " + std::to_string(keyframe.stamp_s) +
                       " s was read before, and now can't be: " + read.error);
    }
    TrackResult track;
    track.state = TrackingState::kTracking;
    track.keyframe = keyframe.id;
    replay.Keyframe(*read.frame, tracked.views.at(keyframe.id), keyframe.frames);
    live.AddLoops(replay.State().loops);
    for (const auto& observer : request.observers) observer->OnFrame(*read.frame, track, replay.State());
    progress.Update(k + 1, std::to_string(CountAccepted(replay.State().loops)) + " loops");
  }
  result.interrupted = InterruptGuard::Requested();
  replay.Finish();
  live.AddLoops(replay.State().loops);
  for (const auto& observer : request.observers) observer->OnEnd(replay.State());
  progress.Finish();
}

}  // namespace

TrackedSequence TrackSequence(RunRequest request, RunConfig config) {
  TrackedSequence sequence;
  config.run.loops = false;
  request.observers.push_back(std::make_shared<SequenceRecorder>(sequence));
  sequence.result = RunSlam(request, config);
  return sequence;
}

RunResult CloseLoops(const TrackedSequence& tracked, const RunRequest& request, const RunConfig& given) {
  if (!tracked.odometry) throw InputError("a sequence without calibration has no odometry to share");
  const internal::Stopwatch watch;
  const double cpu_begin = ProcessCpuSeconds();
  RunResult result = tracked.result;
  result.config = WithOverrides(given, request);
  result.shared_odometry = true;
  result.evaluation.reset();
  result.reference.clear();
  cv::setNumThreads(1);
  const std::unique_ptr<Dataset> dataset = OpenDataset(request.dataset, result.config.dataset);
  std::vector<std::string> warnings;
  const auto reference = ReadReference(*dataset, request, &warnings);
  const InterruptGuard guard;
  OutputFolder folder = OpenOutputFolder(request, reference ? reference->second : std::string());
  const auto tell = [&request](const LoopResult& detection) {
    for (const auto& observer : request.observers) observer->OnDetection(detection);
  };
  Replay replay(Watched(result.config, request), result.rig, *tracked.odometry, {tell, {}});
  LiveFiles live(folder.path(), result.rig, result.config);
  Attempts attempts;
  attempts.Try([&] { CloseAll(tracked, request, *dataset, replay, live, result); });
  attempts.Try([&] {
    const SlamReport report = replay.loops().Report();
    for (const auto& [name, ms] : report.stage_ms) result.stage_ms[name] = ms;
    result.wall_s += watch.Seconds();
    result.cpu_s += ProcessCpuSeconds() - cpu_begin;
    CollectMap(replay.State(), result);
    result.global_adjustments = report.global_adjustments;
    result.graph = replay.loops().Graph(replay.State().odometry->map());
    result.graph_proof = report.graph_proof;
    result.trajectory_odometry = tracked.result.trajectory;
  });
  attempts.Try([&] { MeasureLoops(result); });
  if (reference) attempts.Try([&] { EvaluateRun(reference->first, reference->second, result); });
  result.failure = attempts.Failure();
  WriteOutputs(folder, request, result);
  attempts.Rethrow();
  return result;
}

}  // namespace tutti
