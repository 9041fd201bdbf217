#include "tests/apps/dense/known_geometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

namespace tutti::testing {
namespace {

double DistanceToFace(const Eigen::Vector3d& point, const synthetic::Face& face) {
  // The faces are rectangles.
  const Eigen::Vector3d to = point - face.corner;
  const double u = std::clamp(to.dot(face.edge_u) / face.edge_u.squaredNorm(), 0.0, 1.0);
  const double v = std::clamp(to.dot(face.edge_v) / face.edge_v.squaredNorm(), 0.0, 1.0);
  return (to - u * face.edge_u - v * face.edge_v).norm();
}

// Cells of a world that a face runs through, between these heights above the ground.
class TrueCells {
 public:
  TrueCells(const SyntheticWorld& world, const OccupancyGrid& grid, double low_m, double high_m)
      : grid_(grid), occupied_(cv::Mat::zeros(grid.cells.size(), CV_8UC1)) {
    const double step = 0.25 * grid.cell_m;
    for (const synthetic::Face& face : StillFaces(world)) {
      const int us = static_cast<int>(face.edge_u.norm() / step) + 1,
                vs = static_cast<int>(face.edge_v.norm() / step) + 1;
      for (int u = 0; u <= us; ++u)
        for (int v = 0; v <= vs; ++v)
          Set(grid.T_map_world * (face.corner + face.edge_u * u / us + face.edge_v * v / vs), low_m, high_m);
    }
  }
  // Share of the known cells that are right: occupied with a face in it or in a neighbour, free without one
  // in it.
  double ShareOfRight() const {
    cv::Mat near = occupied_.clone();
    for (int y = 0; y < near.rows; ++y)
      for (int x = 0; x < near.cols; ++x) near.at<std::uint8_t>(y, x) = Near(y, x);
    double known = 0, right = 0;
    for (int y = 0; y < near.rows; ++y) {
      for (int x = 0; x < near.cols; ++x) {
        const int cell = grid_.cells.at<std::int8_t>(y, x);
        if (cell < 0) continue;
        ++known;
        right +=
            (cell > 0 ? near.at<std::uint8_t>(y, x) != 0 : occupied_.at<std::uint8_t>(y, x) == 0) ? 1 : 0;
      }
    }
    return right / known;
  }

 private:
  void Set(const Eigen::Vector3d& at, double low_m, double high_m) {
    if (at.z() < low_m || at.z() > high_m) return;
    const auto x = static_cast<int>(std::floor((at.x() - grid_.origin.x()) / grid_.cell_m));
    const auto y = static_cast<int>(std::floor((at.y() - grid_.origin.y()) / grid_.cell_m));
    if (x >= 0 && y >= 0 && x < occupied_.cols && y < occupied_.rows) occupied_.at<std::uint8_t>(y, x) = 1;
  }
  std::uint8_t Near(int y, int x) const {
    for (int dy = -1; dy <= 1; ++dy)
      for (int dx = -1; dx <= 1; ++dx)
        if (y + dy >= 0 && x + dx >= 0 && y + dy < occupied_.rows && x + dx < occupied_.cols &&
            occupied_.at<std::uint8_t>(y + dy, x + dx) != 0)
          return 1;
    return 0;
  }

  const OccupancyGrid& grid_;
  cv::Mat occupied_;
};

using Cell = std::tuple<long, long, long>;
Cell CellOf(const Eigen::Vector3d& point, double size) {
  return {std::lround(point.x() / size), std::lround(point.y() / size), std::lround(point.z() / size)};
}

}  // namespace

KnownGeometry::KnownGeometry(std::vector<synthetic::Face> faces, double reach_m)
    : faces_(std::move(faces)), reach_(reach_m) {}

double KnownGeometry::Distance(const Eigen::Vector3d& point) const {
  double least = reach_;
  for (const synthetic::Face& face : faces_) least = std::min(least, DistanceToFace(point, face));
  return least;
}

SurfaceQuality Measure(const PointCloud& surface, const KnownGeometry& geometry,
                       const std::vector<Eigen::Vector3d>& seen, double within_m) {
  SurfaceQuality quality;
  std::map<Cell, std::vector<Eigen::Vector3d>> cells;
  double squares = 0, sum = 0;
  for (const Eigen::Vector3f& vertex : surface.points) {
    const Eigen::Vector3d point = vertex.cast<double>();
    const double distance = geometry.Distance(point);
    squares += distance * distance;
    sum += distance;
    quality.worst = std::max(quality.worst, distance);
    cells[CellOf(point, within_m)].push_back(point);
  }
  const auto count = static_cast<double>(std::max<std::size_t>(1, surface.points.size()));
  quality.rms = std::sqrt(squares / count);
  quality.mean = sum / count;
  std::size_t covered = 0;
  for (const Eigen::Vector3d& point : seen) {
    const auto [x, y, z] = CellOf(point, within_m);
    bool near = false;
    for (int n = 0; n < 27 && !near; ++n) {
      const auto cell = cells.find({x + n % 3 - 1, y + n / 3 % 3 - 1, z + n / 9 - 1});
      if (cell == cells.end()) continue;
      near = std::any_of(cell->second.begin(), cell->second.end(),
                         [&](const Eigen::Vector3d& vertex) { return (vertex - point).norm() <= within_m; });
    }
    covered += near ? 1 : 0;
  }
  quality.completeness =
      static_cast<double>(covered) / static_cast<double>(std::max<std::size_t>(1, seen.size()));
  return quality;
}

double ShareOfRightCells(const SyntheticWorld& world, const OccupancyGrid& grid, double low_m,
                         double high_m) {
  return TrueCells(world, grid, low_m, high_m).ShareOfRight();
}

void AppendSeen(const cv::Mat& depth_m, const Pose& T_world_camera, const PinholeCamera& camera, int step,
                std::vector<Eigen::Vector3d>* seen) {
  for (int v = step / 2; v < depth_m.rows; v += step) {
    for (int u = step / 2; u < depth_m.cols; u += step) {
      const auto z = static_cast<double>(depth_m.at<float>(v, u));
      if (z > 0) seen->push_back(T_world_camera * (z * camera.Unproject({u, v})));
    }
  }
}

}  // namespace tutti::testing
