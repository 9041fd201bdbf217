// Where the odometry is less certain than it is as a rule: steps that few or one-sided landmarks hold, and
// slides, in which the camera seems to move faster than it did just before and after.
#pragma once

#include <utility>
#include <vector>

#include "tutti/core/trajectory.h"
#include "tutti/frontend/map.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// The keyframes after `after`, ascending, and how uncertain the step to each is, from the keyframe before it
/// of the same submap:
/// * Common landmarks: standard deviation of the newer pose by the landmarks that both keyframes see, along
///   all directions, for corners of `pixel_sigma` [px]. It counts where it is over three times the map's
///   median.
/// * Slides: a speed of the camera from frame to frame that is over three times the third quartile of the
///   second around it (and moves the view by more than 0.2 % of the depth) is no motion that a hand or a car
///   begins and ends so suddenly. The part of the step beyond that quartile counts as error.
/// 0 where neither applies: what is configured for an odometry holds there.
std::vector<std::pair<int, MotionSigma>> StepSigmas(const Map& map, int after, double pixel_sigma);

}  // namespace tutti
#pragma GCC visibility pop
