// Voxels in blocks, which exist where something was measured.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <unordered_map>
#include <vector>

namespace tutti {

/// What is known at a point of the lattice: a mean over frames.
struct Voxel {
  float distance = 0;                     ///< to the surface along the camera's z, positive before it [m]
  float weight = 0;                       ///< sum over the frames
  std::array<std::uint16_t, 3> bgr = {};  ///< in 256ths of a grey level; zeros: no colour yet
  std::uint16_t frames = 0;               ///< that measured it; stays at 65535
};

constexpr int kBlockSide = 8;
constexpr int kBlockVoxels = kBlockSide * kBlockSide * kBlockSide;

/// Voxels x + 8 (y + 8 z).
using VoxelBlock = std::array<Voxel, kBlockVoxels>;

/// A block's place as one number, 21 bits an axis; ascending by z, y, x.
inline std::uint64_t BlockKey(const Eigen::Vector3i& corner) {
  constexpr int kBits = 21;
  std::uint64_t key = 0;
  for (int axis = 2; axis >= 0; --axis)
    key = key << kBits | static_cast<std::uint64_t>(corner[axis] + (1 << (kBits - 1)));
  return key;
}
inline Eigen::Vector3i BlockCorner(std::uint64_t key) {
  constexpr int kBits = 21;
  Eigen::Vector3i corner;
  for (int axis = 0; axis < 3; ++axis, key >>= kBits)
    corner[axis] = static_cast<int>(key & ((1U << kBits) - 1)) - (1 << (kBits - 1));
  return corner;
}

/// Voxel (i, j, k) is at (i, j, k) * voxel_m in the world. Blocks are numbered in the order in which they
/// were made, which nothing but the sequence of calls decides.
class VoxelBlocks {
 public:
  /// Blocks lie within so many of the origin along each axis.
  static constexpr int kReach = 1 << 19;

  explicit VoxelBlocks(double voxel_m) : voxel_m_(voxel_m) {}

  double voxel_m() const { return voxel_m_; }
  double BlockSize() const { return kBlockSide * voxel_m_; }
  int Count() const { return static_cast<int>(blocks_.size()); }
  const VoxelBlock& block(int i) const { return *blocks_[static_cast<std::size_t>(i)]; }
  VoxelBlock& block(int i) { return *blocks_[static_cast<std::size_t>(i)]; }
  /// Its voxels are 8 * corner + (0..7, 0..7, 0..7).
  const Eigen::Vector3i& corner(int i) const { return corners_[static_cast<std::size_t>(i)]; }
  /// The number of a block; -1 if it is not there.
  int Find(const Eigen::Vector3i& corner) const;
  /// Makes a block that is not there yet.
  void Add(const Eigen::Vector3i& corner);
  /// The voxel (i, j, k); null if its block is not there.
  const Voxel* At(const Eigen::Vector3i& voxel) const;

 private:
  struct Mixed {
    std::size_t operator()(std::uint64_t key) const {  // the finalizer of MurmurHash3
      key = (key ^ (key >> 33)) * 0xff51afd7ed558ccdULL;
      return static_cast<std::size_t>(key ^ (key >> 33));
    }
  };

  double voxel_m_;
  std::vector<std::unique_ptr<VoxelBlock>> blocks_;
  std::vector<Eigen::Vector3i> corners_;
  std::unordered_map<std::uint64_t, int, Mixed> numbers_;
};

}  // namespace tutti
