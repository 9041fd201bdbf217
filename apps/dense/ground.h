// The frame that maps for navigation have: z up from the ground.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "tutti/core/pose.h"
#include "tutti/dense/dense_map.h"

namespace tutti {

/// See OccupiedSpace.
struct MapFrame2d {
  Pose T_map_world;
  bool ground_found = false;
};

/// The ground is the lowest large plane below the cameras that lies level; level is what most surfaces are
/// whose normals point against the cameras' y axes, within 45 degrees. `cameras`: T_world_camera, at least
/// one.
MapFrame2d FindMapFrame(const PointCloud& surface, const std::vector<Pose>& cameras);

}  // namespace tutti
