#include "apps/dense/stages.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/parallel.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using Cells = std::vector<Eigen::Vector3i>;

bool Before(const Eigen::Vector3i& a, const Eigen::Vector3i& b) {
  return std::make_tuple(a.x(), a.y(), a.z()) < std::make_tuple(b.x(), b.y(), b.z());
}

void SortAndThin(Cells* cells) {
  std::sort(cells->begin(), cells->end(), Before);
  cells->erase(std::unique(cells->begin(), cells->end()), cells->end());
}

Eigen::Vector3i CellAt(const Eigen::Vector3d& point, double cell_m) {
  return (point / cell_m).array().floor().matrix().cast<int>();
}

// Blocks of 8 x 8 x 8 cells that blocks of voxels, which lie at a slant to them, may reach into.
Cells ReachedBlocks(const VoxelBlocks& seen, const Pose& T_map_world) {
  const double size = seen.BlockSize(), radius = 0.5 * std::sqrt(3.0) * size;
  Cells reached;
  for (int i = 0; i < seen.Count(); ++i) {
    const Eigen::Vector3d centre =
        T_map_world * (size * (seen.corner(i).cast<double>() + Eigen::Vector3d::Constant(0.5)));
    const Eigen::Vector3i least = CellAt(centre - Eigen::Vector3d::Constant(radius), size);
    const Eigen::Vector3i most = CellAt(centre + Eigen::Vector3d::Constant(radius), size);
    for (int x = least.x(); x <= most.x(); ++x)
      for (int y = least.y(); y <= most.y(); ++y)
        for (int z = least.z(); z <= most.z(); ++z) reached.emplace_back(x, y, z);
  }
  SortAndThin(&reached);
  return reached;
}

Cells FreeCells(const VoxelBlocks& seen, const Pose& T_map_world, const Eigen::Vector3i& block,
                int min_frames) {
  const Pose T_world_map = T_map_world.Inverse();
  Cells cells;
  for (int i = 0; i < kBlockVoxels; ++i) {
    const Eigen::Vector3i cell = kBlockSide * block + Eigen::Vector3i(i >> 6, i >> 3 & 7, i & 7);
    const Eigen::Vector3d centre = seen.voxel_m() * (cell.cast<double>() + Eigen::Vector3d::Constant(0.5));
    const Eigen::Vector3d at = T_world_map * centre / seen.voxel_m();
    const Voxel* voxel = seen.At(at.array().round().matrix().cast<int>());
    if (voxel != nullptr && voxel->frames >= min_frames && voxel->distance > 0) cells.push_back(cell);
  }
  return cells;
}

}  // namespace

OccupiedSpace SpaceIn(const MapFrame2d& frame, const PointCloud& surface, const VoxelBlocks& seen,
                      int min_frames, int threads) {
  OccupiedSpace space;
  space.cell_m = seen.voxel_m();
  space.T_map_world = frame.T_map_world;
  space.ground_found = frame.ground_found;
  for (const Eigen::Vector3f& point : surface.points)
    space.occupied.push_back(CellAt(frame.T_map_world * point.cast<double>(), space.cell_m));
  SortAndThin(&space.occupied);
  const Cells blocks = ReachedBlocks(seen, frame.T_map_world);
  std::vector<Cells> of_blocks(blocks.size());
  RunParallel(static_cast<int>(blocks.size()), threads, [&](int i) {
    const auto at = static_cast<std::size_t>(i);
    of_blocks[at] = FreeCells(seen, frame.T_map_world, blocks[at], min_frames);
  });
  for (const Cells& cells : of_blocks) {
    for (const Eigen::Vector3i& cell : cells) {
      if (!std::binary_search(space.occupied.begin(), space.occupied.end(), cell, Before))
        space.free.push_back(cell);
    }
  }
  std::sort(space.free.begin(), space.free.end(), Before);
  return space;
}

OccupancyGrid GridOf(const OccupiedSpace& space, double low_m, double high_m) {
  if (!(low_m < high_m)) throw InputError("a grid needs a lowest height that is below the highest one");
  // Cells whose centre is in between.
  const auto within = [&](const Eigen::Vector3i& cell) {
    const double centre = space.cell_m * (cell.z() + 0.5);
    return centre > low_m && centre < high_m;
  };
  OccupancyGrid grid;
  grid.cell_m = space.cell_m;
  grid.T_map_world = space.T_map_world;
  Eigen::Array2i least = Eigen::Array2i::Constant(std::numeric_limits<int>::max()), most = -least;
  for (const Cells* cells : {&space.free, &space.occupied}) {
    for (const Eigen::Vector3i& cell : *cells) {
      if (!within(cell)) continue;
      least = least.min(cell.head<2>().array());
      most = most.max(cell.head<2>().array());
    }
  }
  if (least.x() > most.x()) return grid;
  grid.origin = space.cell_m * least.matrix().cast<double>();
  grid.cells = cv::Mat(most.y() - least.y() + 1, most.x() - least.x() + 1, CV_8SC1, cv::Scalar(-1));
  for (const auto& [cells, value] : {std::make_pair(&space.free, 0), std::make_pair(&space.occupied, 100)}) {
    for (const Eigen::Vector3i& cell : *cells) {
      if (within(cell))
        grid.cells.at<std::int8_t>(cell.y() - least.y(), cell.x() - least.x()) =
            static_cast<std::int8_t>(value);
    }
  }
  return grid;
}

}  // namespace tutti
