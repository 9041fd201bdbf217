#include "apps/dense/voxel_blocks.h"

namespace tutti {

int VoxelBlocks::Find(const Eigen::Vector3i& corner) const {
  const auto found = numbers_.find(BlockKey(corner));
  return found == numbers_.end() ? -1 : found->second;
}

void VoxelBlocks::Add(const Eigen::Vector3i& corner) {
  numbers_[BlockKey(corner)] = Count();
  blocks_.push_back(std::make_unique<VoxelBlock>());
  corners_.push_back(corner);
}

const Voxel* VoxelBlocks::At(const Eigen::Vector3i& voxel) const {
  // Shifts and masks round towards minus infinity, as is right for negative numbers.
  const int i = Find({voxel.x() >> 3, voxel.y() >> 3, voxel.z() >> 3});
  if (i < 0) return nullptr;
  const int at = (voxel.x() & 7) + kBlockSide * ((voxel.y() & 7) + kBlockSide * (voxel.z() & 7));
  return &block(i)[static_cast<std::size_t>(at)];
}

}  // namespace tutti
