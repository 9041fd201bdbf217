// A depth image becomes a part of the mean that each voxel holds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "apps/dense/voxel_blocks.h"
#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

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

}  // namespace tutti
