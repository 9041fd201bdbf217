// Which cells are free, and through which a surface runs.
#pragma once

#include "apps/dense/ground.h"
#include "apps/dense/voxel_blocks.h"
#include "tutti/dense/dense_map.h"

namespace tutti {

/// `seen`: voxels as large as a cell, with what lies between the cameras and the surfaces. A cell is free
/// where `min_frames` frames looked through its centre, unless a point of the surface lies in it.
OccupiedSpace SpaceIn(const MapFrame2d& frame, const PointCloud& surface, const VoxelBlocks& seen,
                      int min_frames, int threads);

}  // namespace tutti
