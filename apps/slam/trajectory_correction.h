// How the poses of a trajectory follow its keyframes when loops move them.
#pragma once

#include <vector>

#include "apps/slam/odometry_jumps.h"
#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// A trajectory as moved keyframes say: `odometry` and `before` are poses of the odometry, `after` (as many
/// as `before`, same stamps) where the keyframes are now. Poses between two keyframes are moved by both, the
/// nearer one more; those before the first and after the last keyframe go with it, at the scale of the
/// keyframes next to it. `jumps` (FindJumps): outliers are replaced, keyframes among them left out, and where
/// the odometry began anew a pose is moved by the keyframe on its own side alone. `odometry` comes back as it
/// is, but for outliers, if there are no keyframes. All are T_world_body.
/// Throws InputError if `before` and `after` are not as many.
Trajectory CorrectTrajectory(Trajectory odometry, Trajectory before, Trajectory after,
                             const std::vector<OdometryJump>& jumps = {});

}  // namespace tutti
#pragma GCC visibility pop
