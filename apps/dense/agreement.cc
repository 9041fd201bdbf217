#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "apps/dense/stages.h"

namespace tutti {
namespace {

constexpr int kColumns = 16, kRows = 12;  // of rays
constexpr std::size_t kLeastRays = 40;
constexpr double kSearchedVoxels = 16;    // to both sides of what was measured
constexpr double kStepVoxels = 0.5;       // along a ray
constexpr double kTolerantVoxels = 2;     // what voxels and noise explain: this,
constexpr double kTolerantNoise = 0.005;  // and of structured light and time of flight this times z^2 [1/m]

// Where a ray meets the surface near z, as depth [m]; NaN: nowhere.
double MeetsAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double z, const VoxelBlocks& blocks,
               int min_frames) {
  const double reach = kSearchedVoxels * blocks.voxel_m(), step = kStepVoxels * blocks.voxel_m();
  double before = 0, before_z = 0;  // distance at the step before, where it was known and positive
  for (double at = std::max(step, z - reach); at <= z + reach; at += step) {
    const Eigen::Vector3d voxel = ((eye + at * ray) / blocks.voxel_m()).array().round();
    const Voxel* known = blocks.At(voxel.cast<int>());
    const bool measured = known != nullptr && known->frames >= min_frames;
    const double distance = measured ? static_cast<double>(known->distance) : 0;
    if (measured && distance <= 0 && before > 0)
      return before_z + (at - before_z) * before / (before - distance);
    before = measured ? std::max(0.0, distance) : 0;
    before_z = at;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

bool DisagreesWith(const VoxelBlocks& blocks, const DepthView& view, int min_frames, double* median_m) {
  const PinholeCamera& c = view.camera;
  std::vector<std::pair<double, double>> off;  // share of what is tolerated, [m]
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const int u = (2 * column + 1) * c.width / (2 * kColumns), v = (2 * row + 1) * c.height / (2 * kRows);
      const float inverse = view.inverse_depth.at<float>(v, u);
      if (!(inverse > 0)) continue;
      const double z = 1 / static_cast<double>(inverse);
      const Eigen::Vector3d ray =
          view.T_world_camera.rotation * Eigen::Vector3d((u - c.cx) / c.fx, (v - c.cy) / c.fy, 1);
      const double away = std::abs(MeetsAt(view.T_world_camera.translation, ray, z, blocks, min_frames) - z);
      if (!std::isfinite(away)) continue;
      off.emplace_back(away / (kTolerantVoxels * blocks.voxel_m() + kTolerantNoise * z * z), away);
    }
  }
  if (off.size() < kLeastRays) return false;
  const auto middle = off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2);
  std::nth_element(off.begin(), middle, off.end());
  *median_m = middle->second;
  return middle->first > 1;
}

}  // namespace tutti
