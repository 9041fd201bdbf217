// How two maps become one.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "apps/slam/loop_closing.h"
#include "apps/slam/session_list.h"
#include "tutti/core/camera.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/config.h"
#include "tutti/slam/map_file.h"

namespace tutti {

/// What of a map is merged. References stay valid as long as it is used.
struct MapToMerge {
  const CameraRig& rig;
  LoopClosing& loops;
  SessionList& sessions;
  Odometry& odometry;
};

/// True if the two can be merged in either order (the same configuration and camera), and `map` is the second
/// one then, by the time stamps. Both have an odometry.
bool ComesAfter(const MapInfo& map, const MapInfo& other);

/// Appends one map to another, and joins the two by loops between them. Nothing may be on its way in either.
class MapMerge {
 public:
  MapMerge(const RunConfig& config, const MapToMerge& map, const MapToMerge& other)
      : config_(config), map_(map), other_(other) {}

  /// The other one's keyframes, sessions and loops get new numbers and stand in the map, in submaps of their
  /// own. Throws InputError, and changes nothing, for a camera that does not fit.
  void Append();
  /// The places of each are shown to the detector of the other. Of the loops those join the two that
  /// LoopCloser::Join says; then what is still open is closed (MapConnection). False: none does, and `reason`
  /// says why. `frames`: number of frames of both. `take`: applies an update to the map.
  bool Join(std::int64_t frames, const std::function<void(const LoopUpdate&)>& take, std::string* reason);

 private:
  std::vector<ProposedLoop> LoopsBetween();
  std::vector<ProposedLoop> ProposedByMap();
  std::vector<ProposedLoop> ProposedByOther();

  const RunConfig& config_;
  MapToMerge map_, other_;
  std::vector<LoopPlace> places_, others_;  // that the detectors knew before
  std::int64_t first_frame_ = 0;            // the number here of what is 0 in the other one
  int first_keyframe_ = 0, first_piece_ = 0;
};

}  // namespace tutti
