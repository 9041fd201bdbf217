// One run of `tutti run`, from its first frame to its last.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "apps/run/checkpoint.h"
#include "apps/run/frame_clock.h"
#include "apps/run/live_files.h"
#include "apps/run/odometry_alone.h"
#include "apps/run/planted_loops.h"
#include "apps/run/prefetcher.h"
#include "apps/run/progress.h"
#include "apps/run/run_note.h"
#include "apps/run/run_parts.h"
#include "apps/run/run_progress.h"
#include "apps/run/runner.h"
#include "apps/run/stamp_pauses.h"
#include "apps/run/timing.h"
#include "core/stopwatch.h"
#include "tutti/slam/slam_system.h"

namespace tutti {

/// Tracks the frames of a data set and collects what it found. In order: TrackAll, Count, TrackUntouched,
/// Collect; after TrackAll threw, too. What it is given must outlive it.
class SlamRun {
 public:
  /// `given`: the odometry that is followed; null: there is none.
  SlamRun(const RunRequest& request, const RunConfig& config, const Dataset& dataset,
          const GivenOdometry* given, const std::filesystem::path& out, RunResult& result);

  void TrackAll();
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
  // Every pose of the other odometry, as the keyframes are now.
  void CorrectGiven();
  TrackResult Track(const InputFrame& frame);
  RunState State() const {
    return {slam_->odometry(), slam_->loops(), slam_->Report().corrections, recognised_, session_offsets_};
  }
  // In the map's numbers.
  std::int64_t FirstFrame() const {
    return slam_->odometry() == nullptr ? 0 : slam_->odometry()->LastView().frame_offset;
  }
  std::FILE* Out() const { return request_.quiet ? nullptr : internal::StandardError(); }
  SpanRecorder* Recorder() { return request_.timing || request_.trace ? &recorder_ : nullptr; }
  // Frames that are there by now, of those that the run may see.
  std::size_t Listed() const { return std::min(total_, dataset_.Size()); }
  PrefetchOptions Reading();
  // Features need nothing from before, so they are extracted ahead of the tracking, too.
  void Extract(InputFrame& frame);
  // In real time: passes over the frames that newer ones have made old, and waits for the one that is due.
  void AwaitFrame(Prefetcher& frames);
  // In real time, and with a source that gives each frame but once, nothing may hold the tracking up.
  bool TracksAlong() const;
  bool TracksAfter() const;
  bool AloneBeside() const { return TracksAlong() && config_.run.threads > 1; }
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
  std::string Status() const;

  const RunRequest& request_;
  const RunConfig& config_;
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
  RunProgress so_far_, before_;                // before_: when this process began
  Trajectory resumed_live_;                    // on its way into live_
  std::unique_ptr<OdometryAlone> alone_;       // from before the detector first changed anything
  std::optional<std::int64_t> resumed_alone_;  // its last frame, on the way into alone_
  std::shared_ptr<FrameClock> clock_;          // of playback_
  std::optional<Playback> playback_;           // in real time, unless the source keeps time itself
  std::size_t total_ = 0;                      // most frames; endless for a growing data set
  std::optional<Checkpointer> checkpoints_;
};

}  // namespace tutti
