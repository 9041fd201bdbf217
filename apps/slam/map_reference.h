// Frames of reference: of a map that was merged into another one, and one whose z axis points up.
#pragma once

#include <map>
#include <optional>

#include "tutti/core/pose.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// Where the keyframes of `merged` are in the frame of reference of `first`, a map that was appended to
/// another one and whose keyframes have numbers from `first_keyframe` on: of each piece, the oldest keyframe
/// of `first` is where it was. One camera: what that one sees is as far away as it was. Pieces without
/// keyframes of `first` stay where they are.
std::map<int, Similarity> InFrameOf(const Map& first, int first_keyframe, const Map& merged);

/// The rotation that turns an odometry's world so that its z axis points up; none: no IMU knows where that
/// is.
std::optional<Pose> UprightTurn(const Odometry& odometry);

}  // namespace tutti
#pragma GCC visibility pop
