#include "tutti/pipeline/runner.h"

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
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
  if (request.threads) config.run.threads = *request.threads;
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
    total_ = dataset.Size();
    if (request.max_frames) total_ = std::min(total_, static_cast<std::size_t>(*request.max_frames));
  }

  void TrackAll() {
    const Clock::time_point begin = Clock::now();
    const double cpu_begin = ProcessCpuSeconds();
    Progress progress(config_.run.loops ? "slam" : "odometry", total_, Out());
    Prefetcher frames(dataset_, 0, total_, Ahead(), Recorder());
    std::size_t done = 0;
    while (!InterruptGuard::Requested()) {
      const std::optional<ReadResult> read = frames.Next();
      if (!read) break;
      if (read->frame) {
        TrackOne(*read->frame);
      } else {
        result_.bad.push_back({static_cast<std::int64_t>(done), read->error});
        progress.Note("tutti: frame " + std::to_string(done) + " is skipped: " + read->error);
      }
      NoteWarnings(progress);
      progress.Update(++done, Status());
    }
    result_.interrupted = InterruptGuard::Requested();
    slam_.Finish();
    NoteWarnings(progress);
    progress.Finish();
    if (result_.interrupted) {
      progress.Note("tutti: interrupted after " + std::to_string(done) + " of " + std::to_string(total_) +
                    " frames; writing what is there");
    }
    result_.frames_total = done;
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
    if (odometry == nullptr || slam_.UntouchedNext() < 0) return;
    const auto next = static_cast<std::size_t>(slam_.UntouchedNext());
    const Clock::time_point begin = Clock::now();
    if (config_.run.odometry_pass && next < result_.frames_total) {
      Progress progress("odometry alone", result_.frames_total - next, Out());
      Prefetcher frames(dataset_, next, result_.frames_total, Ahead());
      std::size_t done = 0;
      // After a Ctrl-C this pass is the price of a complete file; a second Ctrl-C ends the process.
      while (const std::optional<ReadResult> read = frames.Next()) {
        if (read->frame) odometry->Track(*read->frame);
        progress.Update(++done, "for trajectory_odometry.txt");
        if (result_.interrupted) break;
        if (InterruptGuard::Requested()) break;
      }
      result_.odometry_complete = done == result_.frames_total - next;
    } else {
      result_.odometry_complete = next >= result_.frames_total;
    }
    result_.odometry_pass_s = Seconds(begin);
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
  std::size_t Ahead() const { return config_.run.threads > 1 ? 4 : 0; }

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
  std::size_t total_ = 0;
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
