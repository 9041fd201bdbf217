// What is done to a map that two have become: loops that nobody proposed, and then all of it adjusted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <utility>

#include "apps/slam/loop_closer.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/config.h"

namespace tutti {

/// References stay valid as long as it is used; nothing may be on its way.
class MapConnection {
 public:
  /// `frames`: number of frames so far.
  MapConnection(const RunConfig& config, std::int64_t frames, LoopCloser* loops, Odometry* odometry)
      : config_(config), frames_(frames), loops_(*loops), odometry_(*odometry) {}

  /// Loops that the detector missed (FindMissedLoops), and then the whole piece of the map adjusted.
  void Connect(int piece);

 private:
  std::size_t CloseMissedLoops();
  bool Converge(int piece);

  const RunConfig& config_;
  std::int64_t frames_;
  LoopCloser& loops_;
  Odometry& odometry_;
  std::set<std::pair<int, int>> offered_;  // candidate, query: a loop vouches once
};

}  // namespace tutti
