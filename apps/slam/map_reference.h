// Frames of reference: of a map that was merged into another one, and one whose z axis points up.
#pragma once

#include <map>
#include <optional>

#include "tutti/backend/pose_graph.h"
#include "tutti/core/pose.h"
#include "tutti/frontend/imu.h"
#include "tutti/frontend/map.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// Where the keyframes of `merged` are in the frame of reference of `first`, a map that was appended to
/// another one and whose keyframes have numbers from `first_keyframe` on: of each piece, the oldest keyframe
/// of `first` is where it was. One camera: what that one sees is as far away as it was. Pieces without
/// keyframes of `first` stay where they are.
std::map<int, Similarity> InFrameOf(const Map& first, int first_keyframe, const Map& merged);

/// The rotation that turns an odometry's world so that its z axis points up; of one camera with the scale
/// that makes metres of its unit, if an IMU knows it to 2 %. None: no IMU knows where up is.
std::optional<Similarity> UprightTurn(const std::optional<ImuReport>& imu);

/// The keyframes of a map whose z axis points up. Where the map has bent, so that what the accelerometer says
/// of up differs from one part of it to another by more than it scatters, the pose graph `graph` of the map
/// is solved with that, too: an edge from keyframes to the world, which knows roll and pitch alone.
std::map<int, Similarity> Upright(const Map& map, const ImuReport& imu, const Similarity& turn,
                                  PoseGraph graph);

}  // namespace tutti
#pragma GCC visibility pop
