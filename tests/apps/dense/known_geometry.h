// How far a surface is from what a synthetic world is made of.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "data/synthetic/rasterizer.h"
#include "data/synthetic/synthetic_world.h"
#include "tutti/dense/dense_map.h"

namespace tutti::testing {

/// Distances of points to the faces of a world.
class KnownGeometry {
 public:
  /// Points are farther away than `reach_m` if no face is nearer.
  KnownGeometry(std::vector<synthetic::Face> faces, double reach_m);
  /// [m], at most reach_m.
  double Distance(const Eigen::Vector3d& point) const;

 private:
  std::vector<synthetic::Face> faces_;
  double reach_;
};

/// How good a surface is. Distances in metres.
struct SurfaceQuality {
  double rms = 0, mean = 0, worst = 0;  ///< of its points to the geometry
  double completeness = 0;              ///< share of what the frames saw that has a point within `within_m`
};

/// `seen`: points that the frames saw.
SurfaceQuality Measure(const PointCloud& surface, const KnownGeometry& geometry,
                       const std::vector<Eigen::Vector3d>& seen, double within_m);

/// Share of the known cells of GridOf(space, low_m, high_m) that are right: occupied with a face of the world
/// in it or in a neighbour, free without one in it.
double ShareOfRightCells(const SyntheticWorld& world, const OccupancyGrid& grid, double low_m, double high_m);

/// Every `step`-th pixel of a depth image, in the world.
void AppendSeen(const cv::Mat& depth_m, const Pose& T_world_camera, const PinholeCamera& camera, int step,
                std::vector<Eigen::Vector3d>* seen);

}  // namespace tutti::testing
