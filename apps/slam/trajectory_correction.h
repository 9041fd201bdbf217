// How the poses of a trajectory follow its keyframes when loops move them.
#pragma once

#include "tutti/core/trajectory.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// A trajectory as moved keyframes say: `odometry` and `before` are poses of the odometry, `after` (as many
/// as `before`, same stamps) where the keyframes are now. Poses between two keyframes are moved by both, the
/// nearer one more; those before the first and after the last keyframe go with it, at the scale of the
/// keyframes next to it. `odometry` comes back as it is if there are no keyframes. All are T_world_body.
/// Throws InputError if `before` and `after` are not as many.
Trajectory CorrectTrajectory(const Trajectory& odometry, const Trajectory& before, const Trajectory& after);

}  // namespace tutti
#pragma GCC visibility pop
