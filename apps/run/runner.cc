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

#include "apps/run/attempts.h"
#include "apps/run/checkpoint.h"
#include "apps/run/interrupt.h"
#include "apps/run/live_files.h"
#include "apps/run/odometry_alone.h"
#include "apps/run/outputs.h"
#include "apps/run/planted_loops.h"
#include "apps/run/prefetcher.h"
#include "apps/run/progress.h"
#include "apps/run/run_evaluation.h"
#include "apps/run/run_note.h"
#include "apps/run/run_parts.h"
#include "apps/run/run_progress.h"
#include "apps/slam/map_state.h"
#include "core/stopwatch.h"
#include "tutti/core/error.h"
#include "tutti/slam/slam_system.h"
#include "tutti/slam/trajectory_closer.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kRunSection = 300;  // of a checkpoint; the odometry without loops may follow

/// One run from its first frame to its last.
class Run {
 public:
  /// `given`: the odometry that is followed; null: there is none.
  Run(const RunRequest& request, const RunConfig& config, const Dataset& dataset, const GivenOdometry* given,
      const fs::path& out, RunResult& result)
      : request_(request),
        config_(config),
        dataset_(dataset),
        given_(given),
        result_(result),
        planted_(config.run, config.loops.seed),
        live_(out, dataset.Rig(), config) {
    if (request.resume) {
      Resume(*request.resume);
    } else if (request.map) {
      GoOnIn(*request.map);
    } else {
      slam_ = std::make_unique<SlamSystem>(Watched(config, request), dataset.Rig(), Recorder());
    }
    if (request.checkpoint_s) checkpoints_.emplace(out / kCheckpoint, *request.checkpoint_s);
    slam_->SetDetectionListener([this](const LoopResult& detection) {
      for (const auto& observer : request_.observers) observer->OnDetection(detection);
    });
    if (!request.observers.empty()) {
      slam_->SetKeyframeListener([this](const InputFrame& frame, int keyframe) {
        for (const auto& observer : request_.observers) observer->OnKeyframe(frame, keyframe, State());
      });
    }
    slam_->SetChangeListener([this](const Odometry& odometry, std::int64_t last) {
      if (alone_ || given_ != nullptr) return;
      alone_ = std::make_unique<OdometryAlone>(odometry, last, AloneBeside());
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
    const double waited_ms = so_far_.read_wait_ms;
    while (!InterruptGuard::Requested()) {
      if (checkpoints_ && checkpoints_->Due()) WriteCheckpoint();
      if (playback_) AwaitFrame(frames);
      const std::optional<FetchedFrame> fetched = frames.Next();
      so_far_.read_wait_ms = waited_ms + frames.WaitedMs();
      if (!fetched) break;
      TakeFrame(*fetched, progress);
      NoteWarnings(progress);
      progress.Update(++so_far_.next, Status());
    }
    result_.interrupted = InterruptGuard::Requested();
    if (checkpoints_) EndCheckpoints(progress);
    slam_->Finish();
    planted_.PlantRest(slam_.get());
    live_.AddLoops(slam_->loops());
    for (const auto& observer : request_.observers) observer->OnEnd(State());
    NoteWarnings(progress);
    progress.Finish();
    if (result_.interrupted) {
      progress.Note("tutti: interrupted after " + std::to_string(so_far_.next) + " of " +
                    std::to_string(Listed()) + " frames; writing what is there");
    }
    if (result_.realtime) {
      progress.Note("tutti: real time: " + std::to_string(so_far_.dropped.size()) + " of " +
                    std::to_string(so_far_.next) + " frames were dropped");
    }
  }

  // What TrackAll went through, also if something broke it off.
  void Count() {
    result_.frames_total = so_far_.next;
    result_.frames_dropped = so_far_.dropped.size();
    result_.frames_listed = dataset_.Size();
    result_.frame_interval_s = FrameInterval(dataset_);
    result_.stage_ms = slam_->StageMilliseconds();
    result_.stage_ms["read"] = so_far_.read_ms;
    result_.stage_ms["read_wait"] = so_far_.read_wait_ms;
    if (!slam_->AppearanceOnly()) result_.stage_ms["odometry_extract"] += so_far_.extract_ms;
    result_.wall_s = WallSeconds();
    if (alone_) alone_->Tracked();
    result_.cpu_s = CpuSeconds();
    if (Recorder() != nullptr) result_.stages = SummarizeStages(recorder_.Spans(), result_.wall_s);
    result_.trajectory_online = live_.trajectory();
  }

  // What the odometry would have done alone: where it has not tracked beside the run, it does now.
  void TrackUntouched() {
    if (!alone_) return;
    const std::size_t begin = alone_->last() < 0 ? 0 : so_far_.positions.at(alone_->last()) + 1;
    if (!TracksAlong() && begin < result_.frames_total)
      result_.odometry_complete = TracksAfter() && TrackAgain(begin, result_.frames_total);
    alone_->Finish();
    result_.odometry_alone_cpu_s = alone_->CpuSeconds();
  }

  void Collect() {
    CollectMap(State(), result_);
    if (request_.map) {
      result_.map = MapGoneOn{request_.map->string(), slam_->Sessions(), {}};
      CollectEarlierSessions(State(), result_);
      CollectStamps(*slam_->odometry(), result_.map->sessions, result_);
    }
    result_.global_adjustments = slam_->GlobalAdjustments();
    result_.frames_relocalized = slam_->Relocalized();
    result_.graph = slam_->Graph();
    result_.graph_proof = slam_->GraphProof();
    if (given_ != nullptr && !slam_->AppearanceOnly()) CorrectGiven();
    if (!alone_) return;
    FrameRange session;
    if (FirstFrame() > 0) session.first = FirstFrame();
    result_.trajectory_odometry = BodyTrajectory(alone_->Tracked().FrameTrajectory(-1, session), result_.rig);
  }

  // The sections of a checkpoint that are the run's own.
  template <class Archive>
  void State(Archive& archive) {
    bool has_alone = alone_ != nullptr;
    std::int64_t alone_last = has_alone ? alone_->last() : -1;
    Trajectory live = live_.trajectory();
    std::map<std::string, std::string> collected;
    if constexpr (!Archive::kReading) {
      for (const auto& observer : request_.observers) {
        if (*observer->Name() != '\0') collected[observer->Name()] = observer->Save();
      }
    }
    archive(so_far_, planted_, live, alone_last, has_alone, collected);
    StateOfGrowing(archive, result_);
    if constexpr (Archive::kReading) {
      if (has_alone) resumed_alone_ = alone_last;
      resumed_live_ = std::move(live);
      for (const auto& observer : request_.observers) {
        const auto found = collected.find(observer->Name());
        if (found != collected.end()) observer->Load(found->second, request_.resume->string());
      }
    }
  }

  MapSnapshot Map() const { return slam_->Snapshot(NoteOf(request_)); }
  std::string Trace() const { return ChromeTrace(recorder_.Spans(), begin_); }

 private:
  // Every pose of the other odometry, as the keyframes are now.
  void CorrectGiven() {
    Trajectory before;
    for (const StampedPose& keyframe : result_.keyframe_trajectory)
      before.push_back({keyframe.stamp_s, given_->At(keyframe.stamp_s).value()});
    result_.trajectory_odometry = given_->trajectory();
    result_.trajectory = CorrectTrajectory(given_->trajectory(), before, result_.keyframe_trajectory);
  }

  TrackResult Track(const InputFrame& frame) {
    if (given_ == nullptr || slam_->AppearanceOnly()) return slam_->Track(frame);
    if (const std::optional<Pose> T_odom_body = given_->At(frame.stamp_s))
      return slam_->Follow(frame, *T_odom_body * result_.rig.T_body_camera);
    TrackResult none;
    none.state = TrackingState::kLost;
    none.reason = "the trajectory has no pose at its time";
    return none;
  }

  RunState State() const { return {slam_->odometry(), slam_->loops(), slam_->Corrections(), FirstFrame()}; }
  // In the map's numbers.
  std::int64_t FirstFrame() const { return slam_->AppearanceOnly() ? 0 : slam_->odometry()->FrameOffset(); }
  std::FILE* Out() const { return request_.quiet ? nullptr : stderr; }
  SpanRecorder* Recorder() { return request_.timing || request_.trace ? &recorder_ : nullptr; }

  // Frames that are there by now, of those that the run may see.
  std::size_t Listed() const { return std::min(total_, dataset_.Size()); }

  PrefetchOptions Reading() {
    PrefetchOptions options;
    options.begin = so_far_.next;
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
    if (slam_->AppearanceOnly()) return;
    const ScopedSpan span(Recorder(), Lane::kReading, "extract");
    frame.features = slam_->odometry()->Extract(frame);
  }

  // In real time: passes over the frames that newer ones have made old, and waits for the one that is due.
  void AwaitFrame(Prefetcher& frames) {
    std::size_t next = so_far_.next;
    while (next + 1 < Listed() && playback_->Due(dataset_.Stamp(next + 1))) ++next;
    frames.SkipTo(next);
    if (next < Listed()) playback_->Reach(dataset_.Stamp(next));
  }

  // In real time, and with a source that gives each frame but once, nothing may hold the tracking up.
  bool TracksAlong() const {
    return config_.run.odometry_pass && !request_.realtime && dataset_.FrameSupply() != Supply::kOnce;
  }
  bool TracksAfter() const {
    return config_.run.odometry_pass && request_.realtime && dataset_.FrameSupply() != Supply::kOnce;
  }
  bool AloneBeside() const { return TracksAlong() && config_.run.threads > 1; }

  // After a run in real time. False if it was interrupted.
  bool TrackAgain(std::size_t begin, std::size_t end) {
    Progress progress("odometry alone", end - begin, Out());
    PrefetchOptions options;
    options.begin = begin;
    options.end = end;
    options.ahead = Reading().ahead;
    options.prepare = [this](InputFrame& frame) { frame.features = slam_->odometry()->Extract(frame); };
    Prefetcher frames(dataset_, options);
    // After a Ctrl-C this pass is the price of a complete file; a second Ctrl-C ends the process.
    for (std::size_t i = begin; i < end; ++i) {
      if (so_far_.dropped.count(i) != 0) continue;
      frames.SkipTo(i);
      const std::optional<FetchedFrame> fetched = frames.Next();
      if (!fetched) return false;
      if (fetched->read.frame) alone_->Track(*fetched->read.frame);
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
    for (const std::string& warning : slam_->TakeWarnings()) progress.Note("tutti: warning: " + warning);
    for (const std::string& problem : live_.TakeProblems()) progress.Note("tutti: warning: " + problem);
    const auto problem = checkpoints_ ? checkpoints_->TakeProblem() : std::nullopt;
    if (problem) progress.Note("tutti: warning: " + *problem);
  }

  void TakeFrame(const FetchedFrame& fetched, Progress& progress) {
    so_far_.read_ms += fetched.read_ms;
    so_far_.extract_ms += fetched.prepare_ms;
    for (; so_far_.next < fetched.position; ++so_far_.next) so_far_.dropped.insert(so_far_.next);
    if (fetched.read.frame) {
      so_far_.positions[fetched.read.frame->index] = so_far_.next;
      CountDepth(fetched.read, progress);
      TrackOne(*fetched.read.frame);
      if (alone_ && TracksAlong()) alone_->Track(*fetched.read.frame);
      return;
    }
    const std::int64_t number = dataset_.Number(so_far_.next);
    result_.bad.push_back({number, fetched.read.error});
    progress.Note("tutti: frame " + std::to_string(number) + " is skipped: " + fetched.read.error);
  }

  double WallSeconds() const { return before_.wall_s + watch_.Seconds(); }
  double CpuSeconds() const {
    return before_.cpu_s + ProcessCpuSeconds() - cpu_begin_ - (alone_ ? alone_->CpuSeconds() : 0.0);
  }

  void WriteCheckpoint() {
    so_far_.wall_s = WallSeconds();
    so_far_.cpu_s = CpuSeconds();
    std::optional<Odometry> alone;
    if (alone_) alone = alone_->Tracked();
    const auto write = [run = StateOf(*this), alone = std::move(alone)](const MapSink& sink) {
      sink(kRunSection, run);
      if (alone) alone->SaveSections(sink);
    };
    checkpoints_->Begin(slam_->Snapshot(NoteOf(request_)), write);
  }

  // A run that ends early leaves one of its last moment.
  void EndCheckpoints(Progress& progress) {
    checkpoints_->Wait();
    if (!result_.interrupted) return;
    WriteCheckpoint();
    checkpoints_->Wait();
    if (const auto problem = checkpoints_->TakeProblem()) {
      progress.Note("tutti: warning: " + *problem);
    } else {
      progress.Note("tutti: go on with: tutti run --resume " + request_.out.string());
    }
  }

  // The run is another session of a map.
  void GoOnIn(const fs::path& map) {
    MapInfo info = ReadMapInfo(map);
    if (!info.rig.calibrated || !result_.rig.calibrated)
      throw InputError(map.string() +
                       ": a recording can only go on in a map with poses, which needs calibrated "
                       "cameras on both sides");
    if (!info.config.run.loops || !config_.run.loops)
      throw InputError(map.string() +
                       ": without loop closure (run.loops, --no-loops) nothing would connect a "
                       "recording with the map; both need it");
    info.config = Watched(config_, request_);
    slam_ = SlamSystem::Load(map, info, Recorder());
    try {
      slam_->BeginSession(result_.rig);
    } catch (const InputError& error) {
      throw InputError(map.string() + ": " + result_.dataset + " can't go on in it: " + error.what());
    }
    live_.Skip(LoopsBefore());
  }

  // Loop records of earlier sessions.
  std::size_t LoopsBefore() const {
    const std::int64_t first = FirstFrame();
    return static_cast<std::size_t>(std::count_if(slam_->loops().begin(), slam_->loops().end(),
                                                  [&](const LoopRecord& l) { return l.query < first; }));
  }

  void Resume(const fs::path& checkpoint) {
    MapInfo info = ReadMapInfo(checkpoint);
    if (StateOf(info.rig) != StateOf(result_.rig))
      throw InputError(checkpoint.string() + ": is of another camera than the data set has by now");
    info.config = Watched(config_, request_);
    slam_ = SlamSystem::Load(checkpoint, info, Recorder(), [this](internal::SectionReader& file) {
      ReadState(file, kRunSection, this);
      if (!resumed_alone_) return;
      Odometry alone(config_.odometry, result_.rig);
      alone.LoadSections(&file);
      alone_ = std::make_unique<OdometryAlone>(alone, *resumed_alone_, AloneBeside());
    });
    live_.Skip(LoopsBefore());
    live_.Resume(std::move(resumed_live_), slam_->loops());
    before_ = so_far_;
    for (const auto& [index, position] : so_far_.positions) {
      if (position >= dataset_.Size() || dataset_.Number(position) != index)
        throw InputError(checkpoint.string() + ": is of another data set than " + result_.dataset +
                         " holds by now");
    }
    const std::size_t next = so_far_.next;
    result_.resumed_from_frame = next < dataset_.Size() ? dataset_.Number(next) : info.last_frame + 1;
  }

  void TrackOne(const InputFrame& frame) {
    const ScopedSpan span(Recorder(), Lane::kTracking, "frame");
    const internal::Stopwatch watch;
    const TrackResult track = Track(frame);
    result_.frame_ms.push_back(watch.Milliseconds());
    if (track.keyframe >= 0) planted_.OnKeyframe(track.keyframe, slam_.get());
    live_.Add(frame.stamp_s, track, State());
    InputFrame numbered = frame;
    numbered.index += FirstFrame();
    for (const auto& observer : request_.observers) observer->OnFrame(numbered, track, State());
    so_far_.state = slam_->AppearanceOnly() ? "appearance only" : ToString(track.state);
    if (slam_->AppearanceOnly() || track.state == TrackingState::kTracking) {
      so_far_.lost_open = false;
      return;
    }
    ++result_.frames_lost;
    if (!so_far_.lost_open || result_.lost.back().state != so_far_.state) {
      result_.lost.push_back({frame.index, frame.index, so_far_.state, track.reason});
      so_far_.lost_open = true;
    }
    result_.lost.back().last = frame.index;
  }

  std::string Status() const {
    std::string status = so_far_.state;
    if (config_.run.loops) {
      const std::vector<LoopRecord>& loops = slam_->loops();
      status += "  loops " + std::to_string(CountAccepted(loops)) + "/" + std::to_string(loops.size());
    }
    return status;
  }

  const RunRequest& request_;
  const RunConfig& config_;
  const Dataset& dataset_;
  const GivenOdometry* given_;
  RunResult& result_;
  SpanRecorder recorder_;
  std::unique_ptr<SlamSystem> slam_;
  PlantedLoops planted_;
  LiveFiles live_;
  Span::Clock::time_point begin_ = Span::Clock::now();
  internal::Stopwatch watch_;
  double cpu_begin_ = ProcessCpuSeconds();
  RunProgress so_far_, before_;                // before_: when this process began
  Trajectory resumed_live_;                    // on its way into live_
  std::unique_ptr<OdometryAlone> alone_;       // from before the detector first changed anything
  std::optional<std::int64_t> resumed_alone_;  // its last frame, on the way into alone_
  std::shared_ptr<FrameClock> clock_;          // of playback_
  std::optional<Playback> playback_;           // in real time, unless the source keeps time itself
  std::size_t total_ = 0;                      // most frames; endless for a growing data set
  std::optional<Checkpointer> checkpoints_;
};

// What can't be written is known before the long work. An earlier trace stays until then.
void CheckTrace(const fs::path& file) {
  if (!std::ofstream(file, std::ios::app))
    throw InputError(file.string() + ": can't be written; check that the folder exists and is writable");
}

}  // namespace

RunResult RunSlam(const RunRequest& request) { return RunSlam(request, LoadConfig(request.config)); }

std::optional<std::pair<RunRequest, RunConfig>> ResumeRequest(const fs::path& out) {
  const fs::path checkpoint = out / kCheckpoint;
  if (!fs::exists(checkpoint)) {
    if (fs::exists(out / "summary.json")) return std::nullopt;
    throw InputError(out.string() + ": holds no " + kCheckpoint +
                     " to go on from (a run with --checkpoint SECONDS writes one) and no result; start it "
                     "again with --config and --dataset");
  }
  const MapInfo info = ReadMapInfo(checkpoint);
  RunRequest request = RequestOf(info.note, checkpoint);
  request.out = out;
  request.resume = checkpoint;
  return std::make_pair(std::move(request), info.config);
}

RunResult RunSlam(const RunRequest& request, const RunConfig& given) {
  RunResult result;
  result.config = WithOverrides(given, request);
  result.config_file = request.config.string();
  result.camera_source = request.camera_source;
  result.camera_guessed = request.camera_guessed;
  result.dataset = request.dataset.string();
  // The modules use threads of their own where that can't change a result; OpenCV's would reorder keypoints.
  cv::setNumThreads(1);
  std::optional<GivenOdometry> odometry;
  if (request.odometry) {
    odometry.emplace(*request.odometry, request.dataset, result.config.dataset);
    result.config = FollowingConfig(result.config);
  }
  const std::unique_ptr<Dataset> dataset =
      odometry ? odometry->Open() : OpenDataset(request.dataset, result.config.dataset);
  result.rig = dataset->Rig();
  std::vector<std::string> warnings = dataset->Warnings();
  if (odometry) warnings.insert(warnings.end(), odometry->notes().begin(), odometry->notes().end());
  const auto reference = ReadReference(*dataset, request, &warnings);
  const InterruptGuard guard;
  if (request.map) RefuseToReplace(request.out, *request.map);
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
  Run run(request, result.config, *dataset, odometry ? &*odometry : nullptr, folder.path(), result);
  Attempts attempts;
  attempts.Try([&] { run.TrackAll(); });
  attempts.Try([&] { run.Count(); });
  if (!attempts.Failed()) attempts.Try([&] { run.TrackUntouched(); });
  attempts.Try([&] { run.Collect(); });
  if (reference) attempts.Try([&] { EvaluateRun(reference->first, reference->second, result); });
  result.failure = attempts.Failure();
  const auto trace = [&run] { return run.Trace(); };
  const auto map = [&run](const fs::path& file) { run.Map().Write(file); };
  WriteOutputs(folder, request, result, map, request.trace ? trace : std::function<std::string()>());
  attempts.Rethrow();
  return result;
}

}  // namespace tutti
