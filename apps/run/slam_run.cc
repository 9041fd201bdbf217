#include "apps/run/slam_run.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "apps/run/camera_clocks.h"
#include "apps/run/interrupt.h"
#include "apps/slam/map_reference.h"
#include "apps/slam/map_state.h"
#include "apps/slam/trajectory_correction.h"
#include "frontend/odometry/odometry_file.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr std::size_t kAskClocks = 10;      // frames
constexpr std::uint32_t kRunSection = 300;  // of a checkpoint; the odometry without loops may follow

}  // namespace

template <class Archive>
void State(Archive& archive, StampedPose& pose) {
  archive(pose.stamp_s, pose.pose);
}

template <class Archive>
void State(Archive& archive, ClocksFound& clocks) {
  archive(clocks.readout_s, clocks.readout_sigma_s, clocks.depth_delay_s, clocks.depth_delay_sigma_s);
}

template <class Archive>
void State(Archive& archive, BadFrame& bad) {
  archive(bad.index, bad.error);
}

template <class Archive>
void State(Archive& archive, LostStretch& lost) {
  archive(lost.first, lost.last, lost.state, lost.reason);
}

template <class Archive>
void State(Archive& archive, FoundFrame& found) {
  archive(found.index, found.stamp_s, found.by_loop);
}

SlamRun::SlamRun(const RunRequest& request, const Dataset& dataset, const GivenOdometry* given,
                 const std::filesystem::path& out, RunResult& result)
    : request_(request),
      dataset_(dataset),
      given_(given),
      result_(result),
      planted_(result.config.run, result.config.loops.seed),
      live_(out, dataset.Rig(), result.config) {
  if (request.resume) {
    Resume(*request.resume);
  } else if (request.map) {
    GoOnIn(*request.map);
  } else {
    slam_ = std::make_unique<SlamSystem>(Watched(result.config, request), dataset.Rig(), Recorder());
    before_.wall_s = result.wall_s;  // of a run that begins anew
    before_.cpu_s = result.cpu_s;
  }
  for (const MapSession& session : slam_->Sessions()) session_offsets_.push_back(session.frame_offset);
  if (request.checkpoint_s) checkpoints_.emplace(out / kCheckpoint, *request.checkpoint_s);
  SlamListeners listeners;
  listeners.on_detection = [this](const LoopResult& detection) {
    for (const auto& observer : request_.observers) observer->OnDetection(detection);
  };
  if (!request.observers.empty()) {
    listeners.on_keyframe = [this](const InputFrame& frame, int keyframe) {
      for (const auto& observer : request_.observers) observer->OnKeyframe(frame, keyframe, State());
    };
  }
  listeners.on_change = [this](const Odometry& odometry, std::int64_t last) {
    if (alone_ || given_ != nullptr) return;
    alone_ = std::make_unique<OdometryAlone>(odometry, last, AloneBeside());
  };
  slam_->SetListeners(std::move(listeners));
  total_ = dataset.FrameSupply() == Supply::kStored ? dataset.Size() : static_cast<std::size_t>(-1);
  result_.endless = dataset.FrameSupply() != Supply::kStored;
  result_.realtime = request.realtime;
  if (!request.realtime || dataset.FrameSupply() == Supply::kOnce) return;
  playback_.emplace(request.clock ? request.clock : std::make_shared<FrameClock>());
}

void SlamRun::TrackAll() {
  const std::size_t frames = total_ == static_cast<std::size_t>(-1) ? 0 : total_;
  for (const auto& observer : request_.observers) observer->OnStart(result_.rig, frames);
  begin_ = Span::Clock::now();
  watch_ = internal::Stopwatch();
  cpu_begin_ = ProcessCpuSeconds();
  Progress progress(result_.config.run.loops ? "slam" : "odometry", frames, Out());
  Prefetcher reader(dataset_, Reading());
  const double waited_ms = so_far_.read_wait_ms;
  while (!InterruptGuard::Requested()) {
    if (checkpoints_ && checkpoints_->Due()) WriteCheckpoint();
    if (playback_) AwaitFrame(reader);
    const std::optional<FetchedFrame> fetched = reader.Next();
    so_far_.read_wait_ms = waited_ms + reader.WaitedMs();
    if (!fetched) break;
    TakeFrame(*fetched, progress);
    NoteWarnings(progress);
    std::string status = so_far_.state;
    if (result_.config.run.loops)
      status += "  loops " + std::to_string(CountAccepted(slam_->loops())) + "/" +
                std::to_string(slam_->loops().size());
    progress.Update(++so_far_.next, status);
    if (!KnowsClocks()) continue;
    result_.wall_s = WallSeconds();
    result_.cpu_s = CpuSeconds();
    return;
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

bool SlamRun::KnowsClocks() {
  const bool anew = dataset_.FrameSupply() == Supply::kStored && !request_.realtime && !request_.map &&
                    !request_.resume && given_ == nullptr && slam_->odometry() != nullptr;
  if (!anew || so_far_.next % kAskClocks != 0) return false;
  if (const auto found = slam_->odometry()->Report().clocks) clocks_ = SureClocks(*found, result_);
  return clocks_.has_value();
}

void SlamRun::Count() {
  result_.frames_total = so_far_.next;
  result_.frames_dropped = so_far_.dropped.size();
  result_.frames_listed = dataset_.Size();
  result_.skipped_share = dataset_.SkippedShare();
  result_.frame_interval_s = FrameInterval(dataset_);
  result_.stage_ms = StageMilliseconds(*slam_);
  result_.stage_ms["read"] = so_far_.read_ms;
  result_.stage_ms["read_wait"] = so_far_.read_wait_ms;
  if (slam_->odometry() != nullptr) result_.stage_ms["odometry_extract"] += so_far_.extract_ms;
  result_.wall_s = WallSeconds();
  if (alone_) alone_->Tracked();
  result_.cpu_s = CpuSeconds();
  if (Recorder() != nullptr) result_.stages = SummarizeStages(recorder_.Spans(), result_.wall_s);
  result_.trajectory_online = live_.trajectory();
}

void SlamRun::TrackUntouched() {
  if (!alone_) return;
  const std::size_t begin = alone_->last() < 0 ? 0 : so_far_.positions.at(alone_->last()) + 1;
  if (!TracksAlong() && begin < result_.frames_total)
    result_.odometry_complete = TracksTwice() && TrackAgain(begin, result_.frames_total);
  alone_->Finish();
  result_.odometry_alone_cpu_s = alone_->CpuSeconds();
}

void SlamRun::Collect() {
  CollectMap(State(), result_);
  if (request_.map) {
    result_.map = MapGoneOn{request_.map->string(), slam_->Sessions(), {}, {}};
    CollectEarlierSessions(State(), result_);
    CollectStamps(State(), result_);
    NoteJoining(result_.map->sessions.back());
  }
  const SlamReport report = slam_->Report();
  result_.global_adjustments = report.global_adjustments;
  result_.graph = slam_->Graph();
  result_.graph_proof = report.graph_proof;
  if (given_ != nullptr && slam_->odometry() != nullptr) {  // every pose of it, as the keyframes are now
    Trajectory before;
    for (const StampedPose& keyframe : result_.keyframe_trajectory)
      before.push_back({keyframe.stamp_s, given_->At(keyframe.stamp_s).value()});
    result_.trajectory_odometry = given_->trajectory();
    result_.trajectory =
        CorrectTrajectory(given_->trajectory(), before, result_.keyframe_trajectory, given_->jumps());
  }
  const FrameRange session = State().Session();
  result_.given_odometry = given_ != nullptr;
  result_.followed = report.followed;
  if (given_ != nullptr) {
    std::vector<OdometryJump>& jumps = result_.followed.jumps;
    std::copy_if(given_->jumps().begin(), given_->jumps().end(), std::back_inserter(jumps),
                 [](const OdometryJump& jump) { return jump.comes_back; });
    std::sort(jumps.begin(), jumps.end(),
              [](const OdometryJump& a, const OdometryJump& b) { return a.to_s < b.to_s; });
  }
  if (given_ == nullptr && slam_->odometry() != nullptr)
    result_.lens_check = CheckLens(*slam_->odometry(), session);
  if (request_.focal_length && slam_->odometry() != nullptr) {
    const FocalLength& before = *request_.focal_length;
    const bool undistorted = before.measured && before.camera.distortion != Distortion::kNone;
    result_.focal_length_of_map =
        FocalLengthOf(*slam_->odometry(), session, undistorted ? before.lens_sigma : 0.0);
    result_.cpu_s += result_.focal_length_of_map->cpu_s;
  }
  if (!alone_) return;
  const Odometry& alone = alone_->Tracked();
  Trajectory poses = FrameTrajectory(alone.map(), -1, session);
  if (const std::optional<Similarity> upright = UprightTurn(alone.Report().imu)) {  // as that of the map
    for (StampedPose& pose : poses)
      pose.pose = Pose(upright->rotation * pose.pose.rotation, *upright * pose.pose.translation);
  }
  result_.trajectory_odometry = BodyTrajectory(poses, result_.rig);
}

void SlamRun::NoteJoining(const MapSession& own) {
  const auto same = [&](const FoundFrame& found) { return found.index == own.joined_at; };
  if (!own.joined_at || std::any_of(result_.found.begin(), result_.found.end(), same)) return;
  const auto position = so_far_.positions.find(*own.joined_at);
  if (position != so_far_.positions.end())
    result_.found.push_back({*own.joined_at, dataset_.Stamp(position->second), true});
}

TrackResult SlamRun::Track(const InputFrame& frame) {
  if (given_ == nullptr || slam_->odometry() == nullptr) return slam_->Track(frame);
  if (const std::optional<Pose> T_odom_body = given_->At(frame.stamp_s)) {
    const double before_s = std::exchange(followed_s_, frame.stamp_s).value_or(frame.stamp_s);
    return slam_->Follow(frame, *T_odom_body * result_.rig.T_body_camera,
                         given_->SigmaBetween(before_s, frame.stamp_s));
  }
  TrackResult none;
  none.state = TrackingState::kLost;
  none.reason = "the trajectory has no pose at its time";
  return none;
}

PrefetchOptions SlamRun::Reading() {
  PrefetchOptions options;
  options.begin = so_far_.next;
  options.end = total_;
  options.ahead = result_.config.run.threads > 1 ? 4 : 0;
  options.stop = &InterruptGuard::Requested;
  options.recorder = Recorder();
  // Features need nothing from before, so they are extracted ahead of the tracking, too.
  options.prepare = [this](InputFrame& frame) {
    if (slam_->odometry() == nullptr) return;
    const ScopedSpan span(Recorder(), Lane::kReading, "extract");
    frame.features = slam_->odometry()->Extract(frame);
  };
  if (request_.realtime && !playback_) {  // a camera keeps its own time
    options.ahead = 1;
    options.newest = true;
  }
  return options;
}

void SlamRun::AwaitFrame(Prefetcher& frames) {
  std::size_t next = so_far_.next;
  while (next + 1 < Listed() && playback_->Due(dataset_.Stamp(next + 1))) ++next;
  frames.SkipTo(next);
  if (next < Listed()) playback_->Reach(dataset_.Stamp(next));
}

bool SlamRun::TrackAgain(std::size_t begin, std::size_t end) {
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

void SlamRun::CountDepth(const ReadResult& read, Progress& progress) {
  const InputFrame& frame = *read.frame;
  if (result_.rig.sensor == Sensor::kMono || !frame.right.empty() || !frame.depth_m.empty()) return;
  ++result_.frames_without_depth;
  if (read.depth_error.empty()) return;
  result_.bad_depth.push_back({frame.index, read.depth_error});
  progress.Note("tutti: frame " + std::to_string(frame.index) + " is tracked without its " +
                    DepthSource(result_.rig.sensor) + " image: " + read.depth_error,
                std::string("frames are tracked without their ") + DepthSource(result_.rig.sensor) +
                    " image; frames.bad_depth in summary.json lists them");
}

void SlamRun::NoteWarnings(Progress& progress) {
  for (const std::string& warning : slam_->TakeWarnings())
    progress.Note("tutti: warning: " + warning, "warnings of the loop closure");
  for (const std::string& problem : live_.TakeProblems()) progress.Note("tutti: warning: " + problem);
  const auto problem = checkpoints_ ? checkpoints_->TakeProblem() : std::nullopt;
  if (problem) progress.Note("tutti: warning: " + *problem);
}

void SlamRun::TakeFrame(const FetchedFrame& fetched, Progress& progress) {
  so_far_.read_ms += fetched.read_ms;
  so_far_.extract_ms += fetched.prepare_ms;
  for (; so_far_.next < fetched.position; ++so_far_.next) so_far_.dropped.insert(so_far_.next);
  if (fetched.read.frame) {
    so_far_.positions[fetched.read.frame->index] = so_far_.next;
    const auto pause = pauses_.Next(fetched.read.frame->index, fetched.read.frame->stamp_s);
    if (pause) progress.Note("tutti: warning: " + *pause, "frames come long after the one before them");
    CountDepth(fetched.read, progress);
    if (!result_.config.dataset.mask.empty() && fetched.read.frame->mask.empty())
      ++result_.frames_without_mask;
    TrackOne(*fetched.read.frame);
    result_.latency_ms.push_back(fetched.prepare_ms + result_.frame_ms.back());
    if (alone_ && TracksAlong()) alone_->Track(*fetched.read.frame);
    return;
  }
  const std::int64_t number = dataset_.Number(so_far_.next);
  result_.bad.push_back({number, fetched.read.error});
  progress.Note("tutti: frame " + std::to_string(number) + " is skipped: " + fetched.read.error,
                "frames are skipped; frames.bad_frames in summary.json lists them");
}

double SlamRun::CpuSeconds() const {
  return (request_.focal_length ? request_.focal_length->cpu_s : 0.0) + before_.cpu_s + ProcessCpuSeconds() -
         cpu_begin_ - (alone_ ? alone_->CpuSeconds() : 0.0);
}

void SlamRun::TrackOne(const InputFrame& frame) {
  const ScopedSpan span(Recorder(), Lane::kTracking, "frame");
  const internal::Stopwatch watch;
  const TrackResult track = Track(frame);
  recognised_ = track.recognised;
  if (recognised_) result_.found.push_back({frame.index, frame.stamp_s});
  result_.frame_ms.push_back(watch.Milliseconds());
  if (track.keyframe >= 0) planted_.OnKeyframe(track.keyframe, slam_.get());
  live_.Add(frame.stamp_s, track, State());
  InputFrame numbered = frame;
  numbered.index += FirstFrame();
  for (const auto& observer : request_.observers) observer->OnFrame(numbered, track, State());
  so_far_.state = slam_->odometry() == nullptr ? "appearance only" : ToString(track.state);
  if (slam_->odometry() == nullptr || track.state == TrackingState::kTracking) {
    so_far_.lost_open = false;
    if (track.by_grey_values) {
      ++result_.frames_by_grey_values;
    } else if (slam_->odometry() != nullptr) {
      result_.frame_inliers.push_back(track.inliers);
    }
    return;
  }
  ++result_.frames_lost;
  if (!so_far_.lost_open || result_.lost.back().state != so_far_.state) {
    result_.lost.push_back({frame.index, frame.index, so_far_.state, track.reason});
    so_far_.lost_open = true;
  }
  result_.lost.back().last = frame.index;
}

// A run on disk: its checkpoints, and how it goes on from one, or in the map of another.

template <class Archive>
void SlamRun::State(Archive& archive) {
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
  archive(result_.frames_lost, result_.frames_without_mask, result_.frames_without_depth, result_.bad,
          result_.bad_depth, result_.lost, result_.found, result_.frame_ms, result_.latency_ms,
          result_.frame_inliers, result_.frames_by_grey_values, result_.clocks_used, result_.begun_anew);
  if constexpr (Archive::kReading) {
    if (has_alone) resumed_alone_ = alone_last;
    resumed_live_ = std::move(live);
    for (const auto& observer : request_.observers) {
      const auto found = collected.find(observer->Name());
      if (found != collected.end()) observer->Load(found->second, request_.resume->string());
    }
  }
}

void SlamRun::WriteCheckpoint() {
  so_far_.wall_s = WallSeconds();
  so_far_.cpu_s = CpuSeconds();
  std::optional<Odometry> alone;
  if (alone_) alone = alone_->Tracked();
  const auto write = [run = StateOf(*this), alone = std::move(alone)](const MapSink& sink) {
    sink(kRunSection, run);
    if (alone) OdometryFile::Save(*alone, sink);
  };
  checkpoints_->Begin(slam_->Snapshot(NoteOf(request_)), write);
}

void SlamRun::EndCheckpoints(Progress& progress) {
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

void SlamRun::GoOnIn(const std::filesystem::path& map) {
  MapInfo info = ReadMapInfo(map);
  if (!info.rig.calibrated || !result_.rig.calibrated)
    throw InputError(
        map.string() +
        ": a recording can only go on in a map with poses, which needs calibrated cameras on both sides");
  if (!info.config.run.loops || !result_.config.run.loops)
    throw InputError(map.string() +
                     ": without loop closure (run.loops, --no-loops) nothing would connect a recording with "
                     "the map; both need it");
  info.config = Watched(result_.config, request_);
  slam_ = LoadMap(map, info, Recorder());
  try {
    slam_->BeginSession(result_.rig);
  } catch (const InputError& error) {
    throw InputError(map.string() + ": " + result_.dataset + " can't go on in it: " + error.what());
  }
  live_.Skip(LoopsBefore());
}

std::size_t SlamRun::LoopsBefore() const {
  const std::int64_t first = slam_->Sessions().back().frame_offset;
  return static_cast<std::size_t>(std::count_if(slam_->loops().begin(), slam_->loops().end(),
                                                [&](const Loop& l) { return l.query < first; }));
}

void SlamRun::Resume(const std::filesystem::path& checkpoint) {
  MapInfo info = ReadMapInfo(checkpoint);
  if (StateOf(info.rig) != StateOf(result_.rig))
    throw InputError(checkpoint.string() + ": is of another camera than the data set has by now");
  info.config = Watched(result_.config, request_);
  slam_ = LoadMap(checkpoint, info, Recorder(), [this](internal::SectionReader& file) {
    ReadState(file, kRunSection, this);
    if (!resumed_alone_) return;
    Odometry alone(result_.config.odometry, result_.rig);
    OdometryFile::Load(&file, &alone);
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

}  // namespace tutti
