// What a DenseMap does one after the other: depth images into voxels, the surface between them, the ground
// below the cameras, and the cells of a map for navigation.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "apps/dense/voxel_blocks.h"
#include "tutti/core/camera.h"
#include "tutti/core/pose.h"
#include "tutti/dense/dense_map.h"

namespace tutti {

/// A depth image that was checked.
struct DepthView {
  PinholeCamera camera;
  Pose T_world_camera;
  cv::Mat inverse_depth;  ///< CV_32FC1 [1/m], 0: none
  cv::Mat bgr;            ///< CV_8UC3, or empty
  double farthest_m = 0;  ///< depth that occurs
};

/// Distances before and behind a surface count within the band, four voxels to each side; voxels that are
/// farther before it are free. Blocks are made up to two voxels around what was measured.
constexpr double kBandVoxels = 4, kMadeVoxels = 2;
/// Free space is kept up to so many voxels from the camera.
constexpr double kFreeVoxels = 200;

/// The blocks that the view needs and that are not there, by ascending key: those around what was measured,
/// and, with `free_space`, all from the camera to there (kFreeVoxels).
std::vector<std::uint64_t> MissingBlocks(const DepthView& view, bool free_space, const VoxelBlocks& blocks,
                                         int threads);

/// Updates all voxels of existing blocks that the view sees, or sees through.
void Fuse(const DepthView& view, int threads, VoxelBlocks* blocks);

/// Does what the view measures lie elsewhere than the surface that at least `min_frames` frames have measured
/// along the same rays, in the median of a sample, by more than voxels and noise explain? `median_m`: how far
/// off, where it does [m].
bool DisagreesWith(const VoxelBlocks& blocks, const DepthView& view, int min_frames, double* median_m);

/// The mesh, and the voxel that each vertex belongs to: each lies on an edge from its voxel to the next along
/// x, y or z. Vertices are in the order of their blocks, then of their voxels.
struct VoxelMesh {
  TriangleMesh mesh;
  std::vector<std::uint64_t> voxels;  ///< one for each vertex: the same number for the same voxel, ascending
};

/// Marching cubes over the cubes whose eight voxels were measured by `min_frames` frames. The same for any
/// number of threads.
VoxelMesh MarchingCubes(const VoxelBlocks& blocks, int min_frames, int threads);

/// Without connected pieces of fewer than `least` triangles.
VoxelMesh WithoutSpecks(const VoxelMesh& whole, std::size_t least);

/// See OccupiedSpace.
struct MapFrame2d {
  Pose T_map_world;
  bool ground_found = false;
};

/// The ground is the lowest large plane below the cameras that lies level; level is what most surfaces are
/// whose normals point against the cameras' y axes, within 45 degrees. `cameras`: T_world_camera, at least
/// one.
MapFrame2d FindMapFrame(const PointCloud& surface, const std::vector<Pose>& cameras);

/// `seen`: voxels as large as a cell, with what lies between the cameras and the surfaces. A cell is free
/// where `min_frames` frames looked through its centre, unless a point of the surface lies in it.
OccupiedSpace SpaceIn(const MapFrame2d& frame, const PointCloud& surface, const VoxelBlocks& seen,
                      int min_frames, int threads);

}  // namespace tutti
