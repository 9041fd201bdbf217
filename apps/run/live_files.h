// What a run knows so far, on disk while it goes on: for whoever looks, in case the run is killed, and for
// `tutti run --resume`.
#pragma once

#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/run_observer.h"
#include "core/stopwatch.h"
#include "tutti/slam/config.h"
#include "tutti/slam/map_file.h"

namespace tutti {

constexpr const char* kLiveTrajectory = "trajectory_live.txt";
constexpr const char* kLiveLoops = "loops_live.csv";
constexpr const char* kCheckpoint = "checkpoint.tutti";

/// A file that grows by whole lines, each of which is the system's once Append returns.
class GrowingFile {
 public:
  /// Begins anew.
  GrowingFile(std::filesystem::path file, const std::string& header);
  ~GrowingFile();
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;

  /// What can't be written waits for the next call: what there is stays a beginning of the whole.
  void Append(const std::string& lines);
  /// Why it does not grow, or that it does again, once each.
  std::optional<std::string> TakeProblem();

 private:
  std::filesystem::path file_;
  int descriptor_;
  std::string waiting_;
  bool held_up_ = false;
  std::optional<std::string> problem_;
};

/// trajectory_live.txt and loops_live.csv. The same bytes for any number of threads.
class LiveFiles {
 public:
  LiveFiles(const std::filesystem::path& folder, const CameraRig& rig, const RunConfig& config);

  /// After each frame: its pose as it is given out now, and the loops that came with it.
  void Add(double stamp_s, const TrackResult& track, const RunState& state);
  /// So many loops are none of this run's: they were in the map that it goes on in.
  void Skip(std::size_t loops) { loops_written_ = loops; }
  /// Loops alone.
  void AddLoops(const std::vector<Loop>& loops);
  /// In place of what the files hold: the poses and loops so far of a run that is gone on with.
  void Resume(Trajectory trajectory, const std::vector<Loop>& loops);
  /// For the terminal: why a file does not grow, or that it does again.
  std::vector<std::string> TakeProblems();

  /// All poses so far, T_world_body.
  const Trajectory& trajectory() const { return trajectory_; }

 private:
  Pose T_camera_body_;
  std::vector<std::string> members_;  // with columns of their own in loops_live.csv
  std::optional<GrowingFile> poses_;  // with a calibration
  GrowingFile loops_;
  std::size_t loops_written_ = 0;
  Trajectory trajectory_;
};

/// Writes checkpoints beside the tracking, one at a time. One that can't be written costs nothing but a
/// message: the one before it stays.
class Checkpointer {
 public:
  /// `interval_s`: least time between two of them; 0: as often as they can be written.
  Checkpointer(std::filesystem::path file, double interval_s)
      : file_(std::move(file)), interval_s_(interval_s) {}
  /// Waits for the one that is being written.
  ~Checkpointer();
  Checkpointer(const Checkpointer&) = delete;
  Checkpointer& operator=(const Checkpointer&) = delete;

  /// True if it is time for one, and none is being written. The first is due at once.
  bool Due();
  /// Begins one. `more`: the run's own sections, on another thread.
  void Begin(MapSnapshot snapshot, std::function<void(const MapSink&)> more);
  /// Waits for it.
  void Wait();
  /// Why the last one could not be written, once.
  std::optional<std::string> TakeProblem();

 private:
  std::filesystem::path file_;
  double interval_s_;
  std::optional<internal::Stopwatch> since_;  // the last one began
  std::future<void> writing_;
  std::optional<std::string> problem_;
};

}  // namespace tutti
