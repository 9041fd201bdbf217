// Dense maps: depth images with known poses become a coloured mesh, a cloud, and space to navigate in.
//
//   tutti::DenseMap map({});
//   for (const View& view : views) map.Integrate(view.depth_m, view.bgr, view.T_world_camera, camera);
//   tutti::WritePly("mesh.ply", map.Mesh());
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/options.h"
#include "tutti/core/pose.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Options of DenseMap.
struct DenseOptions {
  TUTTI_OPTION(double, voxel_m, 0.02,
               "edge of a voxel: details smaller than it are lost, memory and time "
               "grow with its inverse square",
               Basic(), Unit("m"), From(0.001), To(10));
  TUTTI_OPTION(double, max_depth_m, 0, "farther depth is not used; 0: no limit", Basic(), Unit("m"), From(0));
  TUTTI_OPTION(int, min_frames, 3, "a surface is there where so many frames have measured it", From(1),
               To(1000));
  TUTTI_OPTION(bool, free_space, true, "keep which space is free, for Space() and Grid()");
  TUTTI_OPTION(double, cell_m, 0, "edge of a cell of Space() and Grid(); 0: 0.05 m, at least 2.5 voxels",
               Unit("m"), From(0), To(50));
  TUTTI_OPTION(int, memory_mb, 2000, "voxels take at most so much; what is new after that is left out",
               Basic(), Unit("MB"), From(1));
  TUTTI_OPTION(int, threads, 1, "at most so many; the result is the same for any number", From(1), To(1024));
  TUTTI_OPTIONS_END;

  /// Empty if usable, else what is wrong.
  std::string Validate() const;
};

/// Points of surfaces in the world; all three have the same length.
struct PointCloud {
  std::vector<Eigen::Vector3f> points;               ///< [m]
  std::vector<Eigen::Vector3f> normals;              ///< length 1, towards the side that was seen
  std::vector<std::array<std::uint8_t, 3>> colours;  ///< red, green, blue; grey 128 where no image was given
};

/// A surface.
struct TriangleMesh {
  PointCloud vertices;
  /// Indices of vertices, anticlockwise as seen from the side that was seen.
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// Cells that are known, in a map frame: z up, z = 0 on the ground, the origin below the first camera, x to
/// where it looked (ROS REP 103). Cell c spans c * cell_m to (c + 1) * cell_m along each axis.
struct OccupiedSpace {
  double cell_m = 0;
  Pose T_map_world;
  bool ground_found =
      false;  ///< false: up is against the cameras' y axes, and the ground the lowest that was seen
  std::vector<Eigen::Vector3i> occupied;  ///< a surface runs through them; ascending by x, y, z
  std::vector<Eigen::Vector3i> free;      ///< seen through; ascending by x, y, z
};

/// What of the ground a robot can drive on, in the map frame of OccupiedSpace.
struct OccupancyGrid {
  double cell_m = 0;
  Pose T_map_world;
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();  ///< corner of cell (0, 0) of least x and y [m]
  /// CV_8SC1, row: y, column: x, ascending. 0: free, 100: occupied, -1: unknown (nav_msgs/OccupancyGrid).
  cv::Mat cells;
};

/// The grid of the cells between `low_m` and `high_m` above the ground: occupied where one is, free where
/// none is and one is free. Throws InputError unless low_m < high_m.
OccupancyGrid GridOf(const OccupiedSpace& space, double low_m = 0.1, double high_m = 1.0);

/// How far a DenseMap has come.
struct DenseReport {
  std::size_t integrated = 0;  ///< frames
  std::size_t skipped = 0;     ///< frames that Integrate had a problem with
  std::size_t blocks = 0;      ///< of 8 x 8 x 8 voxels
  double memory_mb = 0;        ///< of the voxels
  std::size_t cut = 0;         ///< frames of which something was left out, for memory_mb was reached
  /// Frames whose depth lies elsewhere than the surface that frames before had measured: their poses are
  /// wrong, things have moved, or depth and image have different clocks.
  std::size_t apart = 0;
  double apart_m = 0;  ///< by how much, in the median of a frame: the worst [m]
};

/// A truncated signed distance function (B. Curless, M. Levoy, "A volumetric method for building complex
/// models from range images", SIGGRAPH 1996) in blocks of voxels that exist near surfaces alone (M. Niessner
/// et al., "Real-time 3D reconstruction at scale using voxel hashing", SIGGRAPH Asia 2013). The band is four
/// voxels to each side. A measurement at depth z has the weight of its variance, 1 / z^4, for the depth of
/// stereo and structured light is uncertain by z^2. Poses are final: integrate after the last correction.
///
/// Frames in the same order give the same bytes for any number of threads.
class DenseMap {
 public:
  /// Throws InputError for options that are not usable.
  explicit DenseMap(const DenseOptions& options);
  ~DenseMap();
  DenseMap(DenseMap&&) noexcept;

  /// Adds a depth image: CV_32FC1, z [m], of the camera's size; 0, negative and not finite: no measurement.
  /// `image`: CV_8UC3 (blue first) or CV_8UC1 of the same size, or empty. `camera` has no distortion. Returns
  /// nothing, or why the frame was skipped, in which case the map is as it was.
  std::string Integrate(const cv::Mat& depth_m, const cv::Mat& image, const Pose& T_world_camera,
                        const PinholeCamera& camera);

  /// The surface by marching cubes (W. Lorensen, H. Cline, SIGGRAPH 1987). Pieces of fewer than 32 triangles
  /// are left out.
  TriangleMesh Mesh() const;
  /// One point for each voxel that the mesh runs through: the mean of its vertices there.
  PointCloud Cloud() const;
  /// Free and occupied cells. Throws InputError without DenseOptions::free_space.
  OccupiedSpace Space() const;
  /// GridOf(Space()).
  OccupancyGrid Grid() const;

  const DenseOptions& Options() const;
  const DenseReport& Report() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tutti
#pragma GCC visibility pop
