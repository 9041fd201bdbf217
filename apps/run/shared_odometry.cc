#include "apps/run/shared_odometry.h"

#include <opencv2/core.hpp>
#include <utility>

#include "apps/run/interrupt.h"
#include "apps/run/outputs.h"
#include "apps/run/progress.h"
#include "apps/run/run_evaluation.h"
#include "apps/run/run_parts.h"
#include "core/stopwatch.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

class SequenceRecorder : public RunObserver {
 public:
  explicit SequenceRecorder(TrackedSequence& sequence) : sequence_(sequence) {}
  void OnFrame(const InputFrame&, const TrackResult&, const SlamSystem&) override { ++frames_; }
  void OnKeyframe(const InputFrame& frame, int keyframe, const SlamSystem& slam) override {
    // Called before the OnFrame of the frame that is being tracked.
    sequence_.keyframes.push_back({keyframe, frame.index, frames_ + 1});
    sequence_.views[keyframe] = slam.odometry()->Keyframe(keyframe);
  }
  void OnEnd(const SlamSystem& slam) override {
    if (slam.odometry() != nullptr) sequence_.odometry = std::make_shared<const Odometry>(*slam.odometry());
  }

 private:
  TrackedSequence& sequence_;
  std::int64_t frames_ = 0;
};

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
  PrepareOutputFolder(request.out);
  const InterruptGuard guard;
  SlamSystem slam(Watched(result.config, request), result.rig, *tracked.odometry, tracked.views);
  slam.SetDetectionListener([&request](const LoopResult& detection) {
    for (const auto& observer : request.observers) observer->OnDetection(detection);
  });
  for (const auto& observer : request.observers) observer->OnStart(result.rig);
  Progress progress("loops", tracked.keyframes.size(), request.quiet ? nullptr : stderr);
  for (std::size_t k = 0; k < tracked.keyframes.size() && !InterruptGuard::Requested(); ++k) {
    const TrackedSequence::Keyframe& keyframe = tracked.keyframes[k];
    const ReadResult read = dataset->Read(static_cast<std::size_t>(keyframe.frame));
    if (!read.frame) throw InputError("frame " + std::to_string(keyframe.frame) + " changed: " + read.error);
    TrackResult track;
    track.state = TrackingState::kTracking;
    track.keyframe = keyframe.id;
    slam.Replay(*read.frame, keyframe.id, keyframe.frames);
    for (const auto& observer : request.observers) observer->OnFrame(*read.frame, track, slam);
    progress.Update(k + 1, std::to_string(slam.LoopsAccepted()) + " loops");
  }
  result.interrupted = InterruptGuard::Requested();
  slam.Finish();
  for (const auto& observer : request.observers) observer->OnEnd(slam);
  progress.Finish();
  for (const auto& [name, ms] : slam.StageMilliseconds()) result.stage_ms[name] = ms;
  result.wall_s += watch.Seconds();
  result.cpu_s += ProcessCpuSeconds() - cpu_begin;
  CollectMap(slam, result);
  result.trajectory_odometry = tracked.result.trajectory;
  if (reference) EvaluateRun(reference->first, reference->second, result);
  WriteOutputs(request.out, result);
  return result;
}

}  // namespace tutti
