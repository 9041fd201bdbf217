// Where a trajectory jumps as nothing that moves can.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tutti/core/trajectory.h"
#include "tutti/slam/slam_report.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// All jumps of a trajectory, in order of time. A step is compared with the 14 around it (their median
/// velocity, and what most of 300 steps differ from theirs by): speeding up, stopping and turning take
/// several steps, a jump takes one. Up to 5 poses from which the trajectory comes back, or which begin or end
/// it, are outliers; any other jump lasts.
std::vector<OdometryJump> FindJumps(const Trajectory& trajectory);

/// Outliers get poses between those of their neighbours, at the ends that of the neighbour.
Trajectory WithoutOutliers(Trajectory trajectory, const std::vector<OdometryJump>& jumps);

/// The poses that are none.
Trajectory OnlyInliers(const Trajectory& trajectory, const std::vector<OdometryJump>& jumps);

/// "the odometry jumps by ..."
std::string Sentence(const OdometryJump& jump);

/// Finds jumps while poses come in: a jump is told some 20 poses later.
class JumpWatch {
 public:
  void Add(const StampedPose& pose) { recent_.push_back(pose); }
  /// What was found since the last call. `all`: no pose follows.
  std::vector<OdometryJump> Take(bool all);

 private:
  Trajectory recent_;
  std::size_t looked_at_ = 0;  // poses of recent_
  bool begins_ = true;         // recent_ holds the first pose
  double told_s_ = -1e300;     // jumps up to this time are known
};

}  // namespace tutti
#pragma GCC visibility pop
