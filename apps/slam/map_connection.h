// What is done to a map that two have become: loops that nobody proposed, and then all of it adjusted.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <set>
#include <utility>

#include "apps/slam/loop_closing.h"
#include "tutti/core/camera.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/config.h"

namespace tutti {

/// References stay valid as long as it is used; nothing may be on its way.
class MapConnection {
 public:
  /// `take`: applies an update. `frames`: number of frames so far.
  MapConnection(const RunConfig& config, const CameraRig& rig, std::int64_t frames, LoopClosing* loops,
                Odometry* odometry, std::function<void(const LoopUpdate&)> take)
      : config_(config),
        rig_(rig),
        frames_(frames),
        loops_(*loops),
        odometry_(*odometry),
        take_(std::move(take)) {}

  /// Loops that the detector missed (FindMissedLoops), and then the whole piece of the map adjusted.
  void Connect(int piece);

 private:
  std::size_t CloseMissedLoops();
  void Finish();

  const RunConfig& config_;
  const CameraRig& rig_;
  std::int64_t frames_;
  LoopClosing& loops_;
  Odometry& odometry_;
  std::function<void(const LoopUpdate&)> take_;
  std::set<std::pair<int, int>> offered_;  // candidate, query: a loop vouches once
};

}  // namespace tutti
