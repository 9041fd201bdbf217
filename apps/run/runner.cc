#include "apps/run/runner.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "apps/run/interrupt.h"
#include "apps/run/live_files.h"
#include "apps/run/outputs.h"
#include "apps/run/planted_loops.h"
#include "apps/run/prefetcher.h"
#include "apps/run/progress.h"
#include "apps/run/run_evaluation.h"
#include "apps/run/run_parts.h"
#include "core/stopwatch.h"
#include "tutti/core/error.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

/// One run from its first frame to its last.
class Run {
 public:
  Run(const RunRequest& request, const RunConfig& config, const Dataset& dataset, const fs::path& out,
      RunResult& result)
      : request_(request),
        config_(config),
        dataset_(dataset),
        result_(result),
        slam_(Watched(config, request), dataset.Rig(), Recorder()),
        planted_(config.run, config.loops.seed),
        live_(out, dataset.Rig(), config) {
    slam_.SetDetectionListener([this](const LoopResult& detection) {
      for (const auto& observer : request_.observers) observer->OnDetection(detection);
    });
    if (!request.observers.empty()) {
      slam_.SetKeyframeListener([this](const InputFrame& frame, int keyframe) {
        for (const auto& observer : request_.observers) observer->OnKeyframe(frame, keyframe, State());
      });
    }
    slam_.SetChangeListener([this](const Odometry& odometry, std::int64_t last) {
      if (alone_) return;
      alone_ = odometry;
      alone_last_ = last;
    });
    total_ = dataset.FrameSupply() == Supply::kStored ? dataset.Size() : static_cast<std::size_t>(-1);
    result_.endless = dataset.FrameSupply() != Supply::kStored;
    result_.realtime = request.realtime;
    if (!request.realtime || dataset.FrameSupply() == Supply::kOnce) return;
    clock_ = request.clock ? request.clock : std::make_shared<SteadyFrameClock>();
    playback_.emplace(*clock_);
  }

  void TrackAll() {
    for (const auto& observer : request_.observers) observer->OnStart(result_.rig);
    begin_ = Span::Clock::now();
    watch_ = internal::Stopwatch();
    cpu_begin_ = ProcessCpuSeconds();
    Progress progress(config_.run.loops ? "slam" : "odometry",
                      total_ == static_cast<std::size_t>(-1) ? 0 : total_, Out());
    Prefetcher frames(dataset_, Reading());
    while (!InterruptGuard::Requested()) {
      if (playback_) AwaitFrame(frames);
      const std::optional<FetchedFrame> fetched = frames.Next();
      read_wait_ms_ = frames.WaitedMs();
      if (!fetched) break;
      read_ms_ += fetched->read_ms;
      extract_ms_ += fetched->prepare_ms;
      for (; next_ < fetched->position; ++next_) dropped_.insert(next_);
      if (fetched->read.frame) {
        positions_[fetched->read.frame->index] = next_;
        CountDepth(fetched->read, progress);
        TrackOne(*fetched->read.frame);
      } else {
        result_.bad.push_back({dataset_.Number(next_), fetched->read.error});
        progress.Note("tutti: frame " + std::to_string(dataset_.Number(next_)) +
                      " is skipped: " + fetched->read.error);
      }
      NoteWarnings(progress);
      progress.Update(++next_, Status());
    }
    result_.interrupted = InterruptGuard::Requested();
    slam_.Finish();
    planted_.PlantRest(&slam_);
    live_.AddLoops(slam_.loops());
    for (const auto& observer : request_.observers) observer->OnEnd(State());
    NoteWarnings(progress);
    progress.Finish();
    if (result_.interrupted) {
      progress.Note("tutti: interrupted after " + std::to_string(next_) + " of " + std::to_string(Listed()) +
                    " frames; writing what is there");
    }
    if (result_.realtime) {
      progress.Note("tutti: real time: " + std::to_string(dropped_.size()) + " of " + std::to_string(next_) +
                    " frames were dropped");
    }
  }

  // What TrackAll went through, also if something broke it off.
  void Count() {
    result_.frames_total = next_;
    result_.frames_dropped = dropped_.size();
    result_.frames_listed = dataset_.Size();
    result_.frame_interval_s = FrameInterval(dataset_);
    result_.stage_ms = slam_.StageMilliseconds();
    result_.stage_ms["read"] = read_ms_;
    result_.stage_ms["read_wait"] = read_wait_ms_;
    if (!slam_.AppearanceOnly()) result_.stage_ms["odometry_extract"] += extract_ms_;
    result_.wall_s = watch_.Seconds();
    result_.cpu_s = ProcessCpuSeconds() - cpu_begin_;
    if (Recorder() != nullptr) result_.stages = SummarizeStages(recorder_.Spans(), result_.wall_s);
    result_.trajectory_online = live_.trajectory();
  }

  // What the odometry would have done alone: the copy from before the first change tracks the rest.
  void TrackUntouched() {
    if (!alone_) return;
    const std::size_t begin = positions_.at(alone_last_) + 1, end = result_.frames_total;
    if (begin >= end) return;
    const internal::Stopwatch watch;
    const bool again = config_.run.odometry_pass && dataset_.FrameSupply() != Supply::kOnce;
    result_.odometry_complete = again && TrackAgain(*alone_, begin, end);
    alone_->FinishMapping();
    result_.odometry_pass_s = watch.Seconds();
  }

  void Collect() {
    CollectMap(State(), result_);
    result_.global_adjustments = slam_.GlobalAdjustments();
    result_.frames_relocalized = slam_.Relocalized();
    result_.graph = slam_.Graph();
    result_.graph_proof = slam_.GraphProof();
    if (alone_) result_.trajectory_odometry = BodyTrajectory(alone_->FrameTrajectory(), result_.rig);
  }

  std::string Trace() const { return ChromeTrace(recorder_.Spans(), begin_); }

 private:
  RunState State() const { return {slam_.odometry(), slam_.loops(), slam_.Corrections()}; }
  std::FILE* Out() const { return request_.quiet ? nullptr : stderr; }
  SpanRecorder* Recorder() { return request_.timing || request_.trace ? &recorder_ : nullptr; }

  // Frames that are there by now, of those that the run may see.
  std::size_t Listed() const { return std::min(total_, dataset_.Size()); }

  PrefetchOptions Reading() {
    PrefetchOptions options;
    options.end = total_;
    options.ahead = config_.run.threads > 1 ? 4 : 0;
    options.stop = &InterruptGuard::Requested;
    options.recorder = Recorder();
    options.prepare = [this](InputFrame& frame) { Extract(frame); };
    if (request_.realtime && !playback_) {  // a camera keeps its own time
      options.ahead = 1;
      options.newest = true;
    }
    return options;
  }

  // Features need nothing from before, so they are extracted ahead of the tracking, too.
  void Extract(InputFrame& frame) {
    if (slam_.AppearanceOnly()) return;
    const ScopedSpan span(Recorder(), Lane::kReading, "extract");
    frame.features = slam_.odometry()->Extract(frame);
  }

  // In real time: passes over the frames that newer ones have made old, and waits for the one that is due.
  void AwaitFrame(Prefetcher& frames) {
    std::size_t next = next_;
    while (next + 1 < Listed() && playback_->Due(dataset_.Stamp(next + 1))) ++next;
    frames.SkipTo(next);
    if (next < Listed()) playback_->Reach(dataset_.Stamp(next));
  }

  // False if it was interrupted.
  bool TrackAgain(Odometry& odometry, std::size_t begin, std::size_t end) {
    Progress progress("odometry alone", end - begin, Out());
    PrefetchOptions options;
    options.begin = begin;
    options.end = end;
    options.ahead = Reading().ahead;
    options.prepare = [&odometry](InputFrame& frame) { frame.features = odometry.Extract(frame); };
    Prefetcher frames(dataset_, options);
    // After a Ctrl-C this pass is the price of a complete file; a second Ctrl-C ends the process.
    for (std::size_t i = begin; i < end; ++i) {
      if (dropped_.count(i) != 0) continue;
      frames.SkipTo(i);
      const std::optional<FetchedFrame> fetched = frames.Next();
      if (!fetched) return false;
      if (fetched->read.frame) odometry.Track(*fetched->read.frame);
      progress.Update(i + 1 - begin, "for trajectory_odometry.txt");
      if ((result_.interrupted || InterruptGuard::Requested()) && i + 1 < end) return false;
    }
    return true;
  }

  void CountDepth(const ReadResult& read, Progress& progress) {
    const InputFrame& frame = *read.frame;
    if (result_.rig.sensor == Sensor::kMono || !frame.right.empty() || !frame.depth_m.empty()) return;
    ++result_.frames_without_depth;
    if (read.depth_error.empty()) return;
    result_.bad_depth.push_back({frame.index, read.depth_error});
    progress.Note("tutti: frame " + std::to_string(frame.index) + " is tracked without its " +
                  DepthSource(result_.rig.sensor) + " image: " + read.depth_error);
  }

  void NoteWarnings(Progress& progress) {
    for (const std::string& warning : slam_.TakeWarnings()) progress.Note("tutti: warning: " + warning);
    for (const std::string& problem : live_.TakeProblems()) progress.Note("tutti: warning: " + problem);
  }

  void TrackOne(const InputFrame& frame) {
    const ScopedSpan span(Recorder(), Lane::kTracking, "frame");
    const internal::Stopwatch watch;
    const TrackResult track = slam_.Track(frame);
    result_.frame_ms.push_back(watch.Milliseconds());
    if (track.keyframe >= 0) planted_.OnKeyframe(track.keyframe, &slam_);
    live_.Add(frame.stamp_s, track, State());
    for (const auto& observer : request_.observers) observer->OnFrame(frame, track, State());
    state_ = slam_.AppearanceOnly() ? "appearance only" : ToString(track.state);
    if (slam_.AppearanceOnly() || track.state == TrackingState::kTracking) {
      lost_open_ = false;
      return;
    }
    ++result_.frames_lost;
    if (!lost_open_ || result_.lost.back().state != state_) {
      result_.lost.push_back({frame.index, frame.index, state_, track.reason});
      lost_open_ = true;
    }
    result_.lost.back().last = frame.index;
  }

  std::string Status() const {
    std::string status = state_;
    if (config_.run.loops) {
      status += "  loops " + std::to_string(CountAccepted(slam_.loops())) + "/" +
                std::to_string(slam_.loops().size());
    }
    return status;
  }

  const RunRequest& request_;
  const RunConfig& config_;
  const Dataset& dataset_;
  RunResult& result_;
  SpanRecorder recorder_;
  SlamSystem slam_;
  PlantedLoops planted_;
  LiveFiles live_;
  Span::Clock::time_point begin_ = Span::Clock::now();
  internal::Stopwatch watch_;
  double cpu_begin_ = ProcessCpuSeconds();
  double read_ms_ = 0, extract_ms_ = 0;            // of the thread that reads ahead
  double read_wait_ms_ = 0;                        // of this one for that one
  std::optional<Odometry> alone_;                  // as it was before the detector first changed anything
  std::int64_t alone_last_ = -1;                   // index of the last input frame that it has seen
  std::shared_ptr<FrameClock> clock_;              // of playback_
  std::optional<Playback> playback_;               // in real time, unless the source keeps time itself
  std::size_t total_ = 0;                          // most frames; endless for a growing data set
  std::size_t next_ = 0;                           // position that comes next
  std::set<std::size_t> dropped_;                  // positions
  std::map<std::int64_t, std::size_t> positions_;  // of the input frames, by their index
  std::string state_;
  bool lost_open_ = false;
};

// What can't be written is known before the long work. An earlier trace stays until then.
void CheckTrace(const fs::path& file) {
  if (!std::ofstream(file, std::ios::app))
    throw InputError(file.string() + ": can't be written; check that the folder exists and is writable");
}

}  // namespace

RunResult RunSlam(const RunRequest& request) { return RunSlam(request, LoadConfig(request.config)); }

RunResult RunSlam(const RunRequest& request, const RunConfig& given) {
  RunResult result;
  result.config = WithOverrides(given, request);
  result.config_file = request.config.string();
  result.dataset = request.dataset.string();
  // The modules use threads of their own where that can't change a result; OpenCV's would reorder keypoints.
  cv::setNumThreads(1);
  const std::unique_ptr<Dataset> dataset = OpenDataset(request.dataset, result.config.dataset);
  result.rig = dataset->Rig();
  std::vector<std::string> warnings = dataset->Warnings();
  const auto reference = ReadReference(*dataset, request, &warnings);
  const InterruptGuard guard;
  OutputFolder folder = OpenOutputFolder(request, reference ? fs::path(reference->second) : fs::path());
  if (request.trace) CheckTrace(*request.trace);
  if (!request.quiet) {
    for (const std::string& warning : warnings) std::fprintf(stderr, "tutti: %s\n", warning.c_str());
    if (!result.rig.calibrated) {
      std::fprintf(stderr, "tutti: no camera calibration: appearance only, loops but no trajectory\n");
    }
  }
  result.calibration_findings = CheckCalibration(*dataset).findings;
  if (!request.quiet) {
    for (const CalibrationFinding& f : result.calibration_findings) {
      std::fprintf(stderr, "tutti: warning: the calibration can't be right: %s; %s\n", f.measured.c_str(),
                   f.advice.c_str());
    }
  }
  Run run(request, result.config, *dataset, folder.path(), result);
  Attempts attempts;
  attempts.Try([&] { run.TrackAll(); });
  attempts.Try([&] { run.Count(); });
  if (!attempts.Failed()) attempts.Try([&] { run.TrackUntouched(); });
  attempts.Try([&] { run.Collect(); });
  if (reference) attempts.Try([&] { EvaluateRun(reference->first, reference->second, result); });
  result.failure = attempts.Failure();
  const auto trace = [&run] { return run.Trace(); };
  WriteOutputs(folder, request, result, request.trace ? trace : std::function<std::string()>());
  attempts.Rethrow();
  return result;
}

}  // namespace tutti
