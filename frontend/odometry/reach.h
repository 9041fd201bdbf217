// Where the camera can be by the motion so far.
#pragma once

#include <optional>

#include "frontend/odometry/tracked_frame.h"
#include "tutti/core/pose.h"
#include "tutti/frontend/frame.h"

namespace tutti {

/// Something that fills the image and moves along (a lorry, a door) may hold more landmarks than the world,
/// and would carry the camera with it, or to where it was seen before; and of a row of equal windows each
/// looks like the next one.
struct Reach {
  Eigen::Vector3d center_m;  ///< in the world
  double radius_m = 0;
  bool Has(const Pose& T_camera_world) const;
};

/// Around where the velocity of `last` leads until `time_s`, as far as a camera can be accelerated and poses
/// are known where what it sees is so deep [m]. One camera has no metres: there its way may be half as long
/// or half as long again. None if the motion says nothing: without a velocity or too long after.
std::optional<Reach> ReachOf(const LastFrame& last, double time_s, double depth_m, Sensor sensor);

}  // namespace tutti
