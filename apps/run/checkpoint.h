// Checkpoints: a run as it is, on disk while it goes on, for `tutti run --resume`.
#pragma once

#include <filesystem>
#include <functional>
#include <future>
#include <optional>
#include <string>

#include "core/stopwatch.h"
#include "tutti/slam/map_file.h"

namespace tutti {

constexpr const char* kCheckpoint = "checkpoint.tutti";

/// Writes them beside the tracking, one at a time. One that can't be written costs nothing but a message: the
/// one before it stays.
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
