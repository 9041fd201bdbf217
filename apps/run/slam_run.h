// One run of `tutti run`, from its first frame to its last.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "apps/run/frame_clock.h"
#include "apps/run/live_files.h"
#include "apps/run/odometry_alone.h"
#include "apps/run/prefetcher.h"
#include "apps/run/progress.h"
#include "apps/run/run_parts.h"
#include "apps/run/runner.h"
#include "apps/run/timing.h"
#include "core/stopwatch.h"
#include "tutti/slam/slam_system.h"

namespace tutti {

/// How far a run has come, beside what its SlamSystem and its result know.
struct RunProgress {
  std::size_t next = 0;                           ///< position in the data set that comes next
  std::set<std::size_t> dropped;                  ///< positions
  std::map<std::int64_t, std::size_t> positions;  ///< of the input frames, by their index
  std::string state;                              ///< of the tracking, for the terminal
  bool lost_open = false;                         ///< the last stretch of RunResult::lost goes on
  double read_ms = 0, extract_ms = 0;             ///< of the thread that reads ahead
  double read_wait_ms = 0;                        ///< of the one that tracks for that one
  double wall_s = 0, cpu_s = 0;                   ///< up to here, of all processes of this run

  template <class Archive>
  void State(Archive& archive) {
    archive(next, dropped, positions, state, lost_open, read_ms, extract_ms, read_wait_ms, wall_s, cpu_s);
  }
};

/// Plants loops that look verified and are wrong into a run (run.inject_false_loops,
/// backend/graph/false_loops.h), to see whether the back end keeps them out: one with every third keyframe,
/// in turn a random relative pose, a wrong place taken for the same one, and two that agree with each other,
/// as loops between two corridors that look alike do; as certain as the detector's are. The same run and seed
/// give the same loops.
class PlantedLoops {
 public:
  PlantedLoops(const SlamOptions& options, std::uint64_t seed)
      : left_(options.inject_false_loops), seed_(seed) {}

  /// After each frame that became a keyframe.
  void OnKeyframe(int keyframe, SlamSystem* slam);
  /// After SlamSystem::Finish: those that are left, anywhere.
  void PlantRest(SlamSystem* slam);

  /// For checkpoints.
  template <class Archive>
  void State(Archive& archive) {
    archive(left_, made_, keyframes_);
  }

 private:
  bool Plant(int newest, SlamSystem* slam);

  int left_;
  std::uint64_t seed_;
  int made_ = 0;
  int keyframes_ = 0;
};

/// Tracks the frames of a data set and collects what it found. In order: TrackAll, Count, TrackUntouched,
/// Collect; after TrackAll threw, too. `result` has the configuration. What it is given must outlive it.
class SlamRun {
 public:
  /// `given`: the odometry that is followed; null: there is none.
  SlamRun(const RunRequest& request, const Dataset& dataset, const GivenOdometry* given,
          const std::filesystem::path& out, RunResult& result);

  void TrackAll();
  /// Why TrackAll has stopped: what the images told of an RGB-D camera's clocks, with which a run that begins
  /// anew is more precise; the fields that are sure, 0 for the others. None: it has not stopped for that.
  const std::optional<ClocksFound>& clocks() const { return clocks_; }
  /// What TrackAll went through, also if something broke it off.
  void Count();
  /// What the odometry would have done alone: where it has not tracked beside the run, it does now.
  void TrackUntouched();
  void Collect();

  /// The sections of a checkpoint that are the run's own.
  template <class Archive>
  void State(Archive& archive);
  MapSnapshot Map() const { return slam_->Snapshot(NoteOf(request_)); }
  std::string Trace() const { return ChromeTrace(recorder_.Spans(), begin_); }

 private:
  TrackResult Track(const InputFrame& frame);
  RunState State() const {
    return {slam_->odometry(), slam_->loops(), slam_->Report().corrections, recognised_, session_offsets_};
  }
  // In the map's numbers.
  std::int64_t FirstFrame() const { return session_offsets_.back(); }
  std::FILE* Out() const { return request_.quiet ? nullptr : internal::StandardError(); }
  SpanRecorder* Recorder() { return request_.timing || request_.trace ? &recorder_ : nullptr; }
  // Frames that are there by now, of those that the run may see.
  std::size_t Listed() const { return std::min(total_, dataset_.Size()); }
  PrefetchOptions Reading();
  // In real time: passes over the frames that newer ones have made old, and waits for the one that is due.
  void AwaitFrame(Prefetcher& frames);
  // The odometry alone tracks beside the run, or in real time, where nothing may hold the tracking up, after
  // it.
  bool TracksTwice() const {
    return result_.config.run.odometry_pass && dataset_.FrameSupply() != Supply::kOnce;
  }
  // Whether the clocks of the camera are sure by now; stored data alone can be tracked anew.
  bool KnowsClocks();
  bool TracksAlong() const { return TracksTwice() && !request_.realtime; }
  bool AloneBeside() const { return TracksAlong() && result_.config.run.threads > 1; }
  // After a run in real time. False if it was interrupted.
  bool TrackAgain(std::size_t begin, std::size_t end);
  void CountDepth(const ReadResult& read, Progress& progress);
  void NoteWarnings(Progress& progress);
  void TakeFrame(const FetchedFrame& fetched, Progress& progress);
  double WallSeconds() const { return before_.wall_s + watch_.Seconds(); }
  double CpuSeconds() const;
  void WriteCheckpoint();
  // A run that ends early leaves one of its last moment.
  void EndCheckpoints(Progress& progress);
  // The run is another session of a map.
  void GoOnIn(const std::filesystem::path& map);
  // The recording joined the map by a loop: that is a place that was found, too.
  void NoteJoining(const MapSession& own);
  // Loop records of earlier sessions.
  std::size_t LoopsBefore() const;
  void Resume(const std::filesystem::path& checkpoint);
  void TrackOne(const InputFrame& frame);

  const RunRequest& request_;
  const Dataset& dataset_;
  const GivenOdometry* given_;
  std::vector<std::int64_t> session_offsets_;  // MapSession::frame_offset of all
  bool recognised_ = false;                    // the last frame was
  std::optional<double> followed_s_;           // the last frame that was given a pose
  RunResult& result_;
  SpanRecorder recorder_;
  std::unique_ptr<SlamSystem> slam_;
  PlantedLoops planted_;
  LiveFiles live_;
  StampPauses pauses_;
  Span::Clock::time_point begin_ = Span::Clock::now();
  internal::Stopwatch watch_;
  double cpu_begin_ = ProcessCpuSeconds();
  RunProgress so_far_, before_;                // before_: when this process, or this beginning, began
  Trajectory resumed_live_;                    // on its way into live_
  std::unique_ptr<OdometryAlone> alone_;       // from before the detector first changed anything
  std::optional<std::int64_t> resumed_alone_;  // its last frame, on the way into alone_
  std::optional<Playback> playback_;           // in real time, unless the source keeps time itself
  std::size_t total_ = 0;                      // most frames; endless for a growing data set
  std::optional<Checkpointer> checkpoints_;
  std::optional<ClocksFound> clocks_;
};

}  // namespace tutti
