#include "tutti/pipeline/runner.h"

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <opencv2/core.hpp>
#include <set>
#include <utility>

#include "prefetcher.h"
#include "run_evaluation.h"
#include "text_file.h"
#include "tutti/core/error.h"
#include "tutti/pipeline/interrupt.h"
#include "tutti/pipeline/outputs.h"
#include "tutti/pipeline/progress.h"
#include "tutti/pipeline/slam_system.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double Seconds(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

double PeakMemoryMb() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

double ProcessCpuSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

RunConfig WithOverrides(RunConfig config, const RunRequest& request) {
  if (request.no_loops) config.run.loops = false;
  if (request.follow_s) config.dataset.follow_s = *request.follow_s;
  if (request.threads) config.run.threads = *request.threads;
  if (request.inject_false_loops) config.run.inject_false_loops = *request.inject_false_loops;
  if (request.seed) {
    config.odometry.seed = *request.seed;
    config.loops.seed = *request.seed;
  }
  const std::string problem = config.run.Validate();
  if (!problem.empty()) throw InputError("--threads: " + problem);
  return config;
}

// The ground truth is read before the long work, so that a damaged file is known at once.
std::optional<std::pair<Trajectory, std::string>> ReadReference(const Dataset& dataset,
                                                                const RunRequest& request,
                                                                std::vector<std::string>* warnings) {
  if (request.ground_truth && *request.ground_truth == "none") return std::nullopt;
  const std::optional<fs::path> file =
      request.ground_truth ? request.ground_truth : dataset.GroundTruthFile();
  if (!file) return std::nullopt;
  try {
    return std::make_pair(dataset.ReadGroundTruth(*file, warnings), file->string());
  } catch (const InputError& e) {
    const char* hint = " (ground truth; --ground-truth none runs without it)";
    throw InputError(e.what() + std::string(hint));
  }
}

// T_world_camera -> T_world_body, the frame that ground truth is of.
Trajectory BodyTrajectory(Trajectory trajectory, const CameraRig& rig) {
  const Pose T_camera_body = rig.T_body_camera.Inverse();
  for (StampedPose& pose : trajectory) pose.pose = pose.pose * T_camera_body;
  return trajectory;
}

/// One run from its first frame to its last.
class Run {
 public:
  Run(const RunRequest& request, const RunConfig& config, const Dataset& dataset, RunResult& result)
      : request_(request),
        config_(config),
        dataset_(dataset),
        result_(result),
        slam_(config, dataset.Rig(), Recorder()) {
    total_ = dataset.FrameSupply() == Supply::kStored ? dataset.Size() : static_cast<std::size_t>(-1);
    if (request.max_frames) total_ = std::min(total_, static_cast<std::size_t>(*request.max_frames));
    result_.realtime = request.realtime;
    if (!request.realtime || dataset.FrameSupply() == Supply::kOnce) return;
    clock_ = request.clock ? request.clock : std::make_shared<SteadyFrameClock>();
    playback_.emplace(*clock_);
  }

  void TrackAll() {
    const Clock::time_point begin = Clock::now();
    const double cpu_begin = ProcessCpuSeconds();
    Progress progress(config_.run.loops ? "slam" : "odometry",
                      total_ == static_cast<std::size_t>(-1) ? 0 : total_, Out());
    Prefetcher frames(dataset_, Reading());
    while (!InterruptGuard::Requested()) {
      if (playback_) AwaitFrame(frames);
      const std::optional<FetchedFrame> fetched = frames.Next();
      if (!fetched) break;
      for (; next_ < fetched->position; ++next_) dropped_.insert(next_);
      if (fetched->read.frame) {
        positions_[fetched->read.frame->index] = next_;
        TrackOne(*fetched->read.frame);
      } else {
        result_.bad.push_back({static_cast<std::int64_t>(next_), fetched->read.error});
        progress.Note("tutti: frame " + std::to_string(next_) + " is skipped: " + fetched->read.error);
      }
      NoteWarnings(progress);
      progress.Update(++next_, Status());
    }
    result_.interrupted = InterruptGuard::Requested();
    slam_.Finish();
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
    result_.frames_total = next_;
    result_.frames_dropped = dropped_.size();
    result_.frames_listed = dataset_.Size();
    result_.stage_ms = slam_.StageMilliseconds();
    result_.stage_ms["read_wait"] = frames.WaitedMs();
    result_.wall_s = Seconds(begin);
    result_.cpu_s = ProcessCpuSeconds() - cpu_begin;
    ReportTimes(begin);
  }

  // What the odometry would have done alone: the copy from before the first correction tracks the rest.
  void TrackUntouched() {
    Odometry* odometry = slam_.untouched();
    if (odometry == nullptr) return;
    const std::size_t begin = positions_.at(slam_.UntouchedLast()) + 1, end = result_.frames_total;
    if (begin >= end) return;
    const Clock::time_point start = Clock::now();
    const bool again = config_.run.odometry_pass && dataset_.FrameSupply() != Supply::kOnce;
    result_.odometry_complete = again && TrackAgain(*odometry, begin, end);
    odometry->FinishMapping();
    result_.odometry_pass_s = Seconds(start);
  }

  void Collect() {
    result_.loops = slam_.loops();
    result_.corrections = slam_.Corrections();
    result_.frames_relocalized = slam_.Relocalized();
    result_.appearance_only = slam_.AppearanceOnly();
    result_.peak_memory_mb = PeakMemoryMb();
    if (!slam_.AppearanceOnly()) {
      const Odometry& odometry = *slam_.odometry();
      result_.trajectory = BodyTrajectory(odometry.FrameTrajectory(), result_.rig);
      result_.frames_tracked = result_.trajectory.size();
      const std::vector<int> pieces = odometry.Pieces();
      for (std::size_t i = 1; i < pieces.size(); ++i) {
        result_.other_pieces.push_back(BodyTrajectory(odometry.FrameTrajectory(pieces[i]), result_.rig));
      }
      result_.trajectory_odometry = slam_.untouched() != nullptr
                                        ? BodyTrajectory(slam_.untouched()->FrameTrajectory(), result_.rig)
                                        : result_.trajectory;
      result_.graph = slam_.Graph();
      result_.stereo_row_error_px = odometry.StereoRowErrorPx();
      result_.stereo_matches = odometry.StereoMatches();
      CollectKeyframes(odometry);
    }
  }

 private:
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

  void NoteWarnings(Progress& progress) {
    for (const std::string& warning : slam_.TakeWarnings()) progress.Note("tutti: warning: " + warning);
  }

  void ReportTimes(Clock::time_point begin) {
    if (Recorder() == nullptr) return;
    const std::vector<Span> spans = recorder_.Spans();
    result_.stages = SummarizeStages(spans, result_.wall_s);
    if (request_.trace) WriteTextFile(*request_.trace, ChromeTrace(spans, begin));
  }

  void TrackOne(const InputFrame& frame) {
    const ScopedSpan span(Recorder(), Lane::kTracking, "frame");
    const Clock::time_point begin = Clock::now();
    const TrackResult track = slam_.Track(frame);
    result_.frame_ms.push_back(1e3 * Seconds(begin));
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
      status +=
          "  loops " + std::to_string(slam_.LoopsAccepted()) + "/" + std::to_string(slam_.loops().size());
    }
    return status;
  }

  // Keyframes of the map piece that trajectory.txt is of.
  void CollectKeyframes(const Odometry& odometry) {
    const std::vector<std::int64_t> frames = odometry.FrameIndices();
    const std::set<std::int64_t> posed(frames.begin(), frames.end());
    Trajectory keyframes;
    for (const int id : odometry.KeyframeIds()) {
      if (posed.count(odometry.KeyframeFrameIndex(id)) == 0) continue;
      keyframes.push_back({odometry.KeyframeStamp(id), odometry.KeyframePose(id)});
    }
    result_.keyframes = odometry.KeyframeIds().size();
    result_.keyframe_trajectory = BodyTrajectory(std::move(keyframes), result_.rig);
  }

  const RunRequest& request_;
  const RunConfig& config_;
  const Dataset& dataset_;
  RunResult& result_;
  SpanRecorder recorder_;
  SlamSystem slam_;
  std::shared_ptr<FrameClock> clock_;              // of playback_
  std::optional<Playback> playback_;               // in real time, unless the source keeps time itself
  std::size_t total_ = 0;                          // most frames; endless for a growing data set
  std::size_t next_ = 0;                           // position that comes next
  std::set<std::size_t> dropped_;                  // positions
  std::map<std::int64_t, std::size_t> positions_;  // of the input frames, by their index
  std::string state_;
  bool lost_open_ = false;
};

}  // namespace

RunResult RunSlam(const RunRequest& request) { return RunSlam(request, LoadConfig(request.config)); }

RunResult RunSlam(const RunRequest& request, const RunConfig& given) {
  RunResult result;
  result.config = WithOverrides(given, request);
  result.config_file = request.config.string();
  result.dataset = request.dataset.string();
  if (request.max_frames && *request.max_frames < 1) throw InputError("--max-frames: must be at least 1");
  // The modules use threads of their own where that can't change a result; OpenCV's would reorder keypoints.
  cv::setNumThreads(1);
  const std::unique_ptr<Dataset> dataset = OpenDataset(request.dataset, result.config.dataset);
  result.rig = dataset->Rig();
  std::vector<std::string> warnings = dataset->Warnings();
  const auto reference = ReadReference(*dataset, request, &warnings);
  PrepareOutputFolder(request.out);
  if (request.trace)
    WriteTextFile(*request.trace, "");  // what can't be written is known before the long work
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
  const InterruptGuard guard;
  Run run(request, result.config, *dataset, result);
  run.TrackAll();
  run.TrackUntouched();
  run.Collect();
  if (reference) EvaluateRun(reference->first, reference->second, result);
  WriteOutputs(request.out, result);
  return result;
}

}  // namespace tutti
