// What a SLAM run did so far, beside poses and loops.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tutti/backend/keyframe_graph.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Where another odometry moves as nothing can (a pose that is wrong, an odometry that began anew).
struct OdometryJump {
  double from_s = 0, to_s = 0;  ///< the last pose before and the first one after it; infinite: none
  double distance_m = 0;        ///< farther than the speed around it says
  double angle_rad = 0;         ///< the same of its rotation
  bool comes_back = false;      ///< the poses between the two are wrong; else the jump lasts
};

/// How uncertain another odometry counts as between two keyframes, as standard deviations
/// (SlamSystem::Follow).
struct FollowedUncertainty {
  double stated_fraction = 0;       ///< of the way, by the odometry itself, else as configured [1]
  double stated_rotation_rad = 0;   ///< the same of the rotation
  double seen_fraction = 0;         ///< what its disagreement with the images comes to; 0: too few steps
  double seen_rotation_rad = 0;     ///< where it is larger than what is stated, it counts instead
  std::vector<OdometryJump> jumps;  ///< steps that have no weight
};

struct SlamReport {
  int corrections = 0;           ///< how often loops moved the map
  int global_adjustments = 0;    ///< how often the whole map was adjusted (bundle adjustment) after that
  std::size_t relocalized = 0;   ///< lost frames that got a pose because the detector knew their place
  FollowedUncertainty followed;  ///< of the odometry that is followed
  /// With graph.certify, of the last solution of the pose graph that moved the map: where each start leads,
  /// and whether the best of them is the global optimum.
  std::optional<KeyframeGraphProof> graph_proof;
  /// Milliseconds spent, summed, by stage, without the odometry's (StageMilliseconds).
  std::map<std::string, double> stage_ms;
};

}  // namespace tutti
#pragma GCC visibility pop
