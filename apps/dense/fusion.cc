#include "apps/dense/stages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/parallel.h"

namespace tutti {
namespace {

// Of a number that is not negative; std::lround takes several times as long.
int Rounded(float number) {
  return static_cast<int>(number + 0.5F);  // NOLINT(bugprone-incorrect-roundings)
}

constexpr float kNear = 0.01F;  // [m]
// Depth is interpolated between pixels whose inverse depths differ by less than this share, times 1/f: where
// the surface is seen at less than about 84 degrees from its normal. Else there is an edge between them.
constexpr float kSteepest = 15;

// Keys of the blocks along the rays of some rows.
class TouchedBlocks {
 public:
  TouchedBlocks(const DepthView& view, bool free_space, double voxel_m)
      : view_(view),
        R_(view.T_world_camera.rotation.toRotationMatrix()),
        free_space_(free_space),
        voxel_(voxel_m),
        block_(kBlockSide * voxel_m) {}

  std::vector<std::uint64_t> OfRows(int first, int last) {
    // Free space is all that lies between the rays: they may be as far apart as half a block is wide.
    const double spread = 0.5 * block_ * view_.camera.fx / std::max(view_.farthest_m, voxel_);
    const int step = free_space_ ? std::clamp(static_cast<int>(spread), 1, 8) : 2;
    for (int v = (first + step - 1) / step * step; v < last; v += step) {
      const float* row = view_.inverse_depth.ptr<float>(v);
      for (int u = 0; u < view_.inverse_depth.cols; u += step) {
        if (row[u] > 0) AlongRay(u, v, 1.0 / static_cast<double>(row[u]));
      }
    }
    std::sort(keys_.begin(), keys_.end());
    keys_.erase(std::unique(keys_.begin(), keys_.end()), keys_.end());
    return std::move(keys_);
  }

 private:
  void AlongRay(int u, int v, double depth) {
    const PinholeCamera& c = view_.camera;
    const Eigen::Vector3d ray = R_ * Eigen::Vector3d((u - c.cx) / c.fx, (v - c.cy) / c.fy, 1);
    const double made = kMadeVoxels * voxel_;
    if (!free_space_) {
      for (const double z : {depth - made, depth, depth + made}) Touch(ray, z);
      return;
    }
    const double end = std::min(depth + made, kFreeVoxels * voxel_);
    for (double z = 0; z < end; z += 0.5 * block_) Touch(ray, z);
    Touch(ray, end);
  }

  void Touch(const Eigen::Vector3d& ray, double z) {
    const Eigen::Vector3d at = (view_.T_world_camera.translation + z * ray) / block_;
    const std::uint64_t key = BlockKey(at.array().floor().matrix().cast<int>());
    // Neighbours mostly touch the same ones.
    for (const std::uint64_t recent : recent_) {
      if (recent == key) return;
    }
    recent_[next_++ % recent_.size()] = key;
    keys_.push_back(key);
  }

  const DepthView& view_;
  const Eigen::Matrix3d R_;
  const bool free_space_;
  const double voxel_, block_;
  std::vector<std::uint64_t> keys_;
  std::array<std::uint64_t, 8> recent_ = {};
  std::size_t next_ = 0;
};

// What the view says of a block's voxels.
class BlockFusion {
 public:
  BlockFusion(const DepthView& view, double voxel_m)
      : view_(view),
        fx_(static_cast<float>(view.camera.fx)),
        fy_(static_cast<float>(view.camera.fy)),
        cx_(static_cast<float>(view.camera.cx)),
        cy_(static_cast<float>(view.camera.cy)),
        voxel_(static_cast<float>(voxel_m)),
        band_(static_cast<float>(kBandVoxels * voxel_m)),
        edge_(kSteepest / static_cast<float>(view.camera.fx)),
        T_camera_world_(view.T_world_camera.Inverse()) {
    step_ = voxel_ * T_camera_world_.rotation.toRotationMatrix().cast<float>();
  }

  // May the view see a point of the block, before or within the band of a surface?
  bool Sees(const Eigen::Vector3d& first_voxel) const {
    const double size = (kBlockSide - 1) * static_cast<double>(voxel_), radius = 0.5 * std::sqrt(3.0) * size;
    const Eigen::Vector3d at = T_camera_world_ * (first_voxel + Eigen::Vector3d::Constant(0.5 * size));
    if (at.z() < -radius || at.z() > view_.farthest_m + static_cast<double>(band_) + radius) return false;
    const PinholeCamera& c = view_.camera;
    const auto outside = [&](double f, double x,
                             double from) {  // f x + from z < 0: beyond a side of the image
      return f * x + from * at.z() < -radius * std::hypot(f, from);
    };
    return !outside(c.fx, at.x(), c.cx) && !outside(-c.fx, at.x(), c.width - 1 - c.cx) &&
           !outside(c.fy, at.y(), c.cy) && !outside(-c.fy, at.y(), c.height - 1 - c.cy);
  }

  void Update(const Eigen::Vector3d& first_voxel, VoxelBlock* block) const {
    const Eigen::Vector3f first = (T_camera_world_ * first_voxel).cast<float>();
    Voxel* voxel = block->data();
    for (int z = 0; z < kBlockSide; ++z) {
      for (int y = 0; y < kBlockSide; ++y) {
        const Eigen::Vector3f row =
            first + static_cast<float>(z) * step_.col(2) + static_cast<float>(y) * step_.col(1);
        for (int x = 0; x < kBlockSide; ++x, ++voxel)
          UpdateVoxel(row + static_cast<float>(x) * step_.col(0), voxel);
      }
    }
  }

 private:
  // `at`: in the camera's frame.
  void UpdateVoxel(const Eigen::Vector3f& at, Voxel* voxel) const {
    if (at.z() < kNear) return;
    const float inverse_z = 1 / at.z();
    const float u = fx_ * at.x() * inverse_z + cx_, v = fy_ * at.y() * inverse_z + cy_;
    if (!(u >= 0 && v >= 0 && u <= static_cast<float>(view_.camera.width - 1) &&
          v <= static_cast<float>(view_.camera.height - 1)))
      return;
    const int near_u = Rounded(u), near_v = Rounded(v);
    float inverse = view_.inverse_depth.ptr<float>(near_v)[near_u];
    if (!(inverse > 0)) return;
    float ahead = 1 / inverse - at.z();
    if (ahead < -2 * band_) return;
    if (ahead < 2 * band_) {
      inverse = Interpolated(u, v, inverse);
      ahead = 1 / inverse - at.z();
      if (ahead < -band_) return;
    }
    // Behind the surface by more than a voxel the weight falls to 0: what lies there may be seen from its
    // other side (H. Oleynikova et al., "Voxblox", IROS 2017, eq. 5).
    float weight = inverse * inverse * inverse * inverse;
    if (ahead < -voxel_) weight *= (band_ + ahead) / (band_ - voxel_);
    const float before = voxel->weight, sum = before + weight;
    if (!(sum > 0)) return;
    voxel->distance += (std::min(ahead, band_) - voxel->distance) * (weight / sum);
    voxel->weight = sum;
    if (voxel->frames < std::numeric_limits<std::uint16_t>::max()) ++voxel->frames;
    if (!view_.bgr.empty() && ahead < band_)
      Colour(view_.bgr.ptr<std::uint8_t>(near_v) + 3 * near_u, weight / sum, voxel);
  }

  // Inverse depth is linear over the image of a plane.
  float Interpolated(float u, float v, float nearest) const {
    const int left = std::min(static_cast<int>(u), view_.camera.width - 2);
    const int top = std::min(static_cast<int>(v), view_.camera.height - 2);
    const float* upper = view_.inverse_depth.ptr<float>(top) + left;
    const float* lower = view_.inverse_depth.ptr<float>(top + 1) + left;
    const float least = std::min(std::min(upper[0], upper[1]), std::min(lower[0], lower[1]));
    const float most = std::max(std::max(upper[0], upper[1]), std::max(lower[0], lower[1]));
    if (!(least > 0) || most - least > edge_ * most) return nearest;
    const float right = u - static_cast<float>(left), down = v - static_cast<float>(top);
    return (1 - down) * (upper[0] + right * (upper[1] - upper[0])) +
           down * (lower[0] + right * (lower[1] - lower[0]));
  }

  static void Colour(const std::uint8_t* bgr, float share, Voxel* voxel) {
    const bool first = voxel->bgr == std::array<std::uint16_t, 3>{};
    for (std::size_t c = 0; c < 3; ++c) {
      const float is = static_cast<float>(voxel->bgr[c]), seen = 256 * static_cast<float>(bgr[c]);
      voxel->bgr[c] = static_cast<std::uint16_t>(Rounded(first ? seen : is + (seen - is) * share));
    }
  }

  const DepthView& view_;
  const float fx_, fy_, cx_, cy_, voxel_, band_, edge_;
  const Pose T_camera_world_;
  Eigen::Matrix3f step_;  // from a voxel to the next, in the camera's frame
};

// Calls work(first, last) for parts of 0 .. count.
template <class Work>
void InParts(int count, int parts, int threads, const Work& work) {
  RunParallel(parts, threads,
              [&](int part) { work(part, part * count / parts, (part + 1) * count / parts); });
}

}  // namespace

std::vector<std::uint64_t> MissingBlocks(const DepthView& view, bool free_space, const VoxelBlocks& blocks,
                                         int threads) {
  constexpr int kParts = 8;
  std::array<std::vector<std::uint64_t>, kParts> touched;
  InParts(view.inverse_depth.rows, kParts, threads, [&](int part, int first, int last) {
    touched[static_cast<std::size_t>(part)] =
        TouchedBlocks(view, free_space, blocks.voxel_m()).OfRows(first, last);
  });
  std::vector<std::uint64_t> missing;
  for (const std::vector<std::uint64_t>& keys : touched) {
    for (const std::uint64_t key : keys) {
      if (blocks.Find(BlockCorner(key)) < 0) missing.push_back(key);
    }
  }
  std::sort(missing.begin(), missing.end());
  missing.erase(std::unique(missing.begin(), missing.end()), missing.end());
  return missing;
}

void Fuse(const DepthView& view, int threads, VoxelBlocks* blocks) {
  const BlockFusion fusion(view, blocks->voxel_m());
  const int parts = std::clamp(blocks->Count() / 64, 1, 64);
  InParts(blocks->Count(), parts, threads, [&](int, int first, int last) {
    for (int i = first; i < last; ++i) {
      const Eigen::Vector3d at = blocks->BlockSize() * blocks->corner(i).cast<double>();
      if (fusion.Sees(at)) fusion.Update(at, &blocks->block(i));
    }
  });
}

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
