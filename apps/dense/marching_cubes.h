// The surface between voxels that lie before it and voxels behind.
#pragma once

#include "apps/dense/voxel_blocks.h"
#include "tutti/dense/dense_map.h"

namespace tutti {

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

}  // namespace tutti
