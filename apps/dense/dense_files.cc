#include "tutti/dense/dense_files.h"

#include <cstdio>
#include <system_error>

#include "core/little_endian.h"
#include "core/replaced_file.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::AppendLittleEndian;

std::string PlyOf(const PointCloud& vertices, const std::vector<std::array<std::uint32_t, 3>>& triangles,
                  bool mesh) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\ncomment written by tutti; metres, in the world of the "
      "trajectory\n"
      "element vertex " +
      std::to_string(vertices.points.size()) +
      "\nproperty float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (mesh)
    bytes +=
        "element face " + std::to_string(triangles.size()) + "\nproperty list uchar int vertex_indices\n";
  bytes += "end_header\n";
  bytes.reserve(bytes.size() + 27 * vertices.points.size() + 13 * triangles.size());
  for (std::size_t i = 0; i < vertices.points.size(); ++i) {
    for (const float coordinate : vertices.points[i]) AppendLittleEndian(coordinate, &bytes);
    for (const float coordinate : vertices.normals[i]) AppendLittleEndian(coordinate, &bytes);
    for (const std::uint8_t channel : vertices.colours[i]) AppendLittleEndian(channel, &bytes);
  }
  for (const auto& triangle : triangles) {
    AppendLittleEndian(std::uint8_t{3}, &bytes);
    for (const std::uint32_t corner : triangle) AppendLittleEndian(corner, &bytes);
  }
  return bytes;
}

// Values of map_server's trinary pictures.
char GreyOf(std::int8_t cell) {
  const int grey = cell < 0 ? 205 : cell > 0 ? 0 : 254;
  return static_cast<char>(grey);
}

std::string YamlOf(const OccupancyGrid& grid) {
  const auto& R = grid.T_map_world.rotation;
  const auto& t = grid.T_map_world.translation;
  char text[800];
  std::snprintf(
      text, sizeof text,
      "# written by tutti: z up from the ground, the origin below the first camera, x to where it looked\n"
      "# from the trajectory's world to this map, tx ty tz [m] qx qy qz qw: "
      "%.6f %.6f %.6f %.8f %.8f %.8f %.8f\n"
      "image: map.pgm\nmode: trinary\nresolution: %.6g\norigin: [%.6f, %.6f, 0.0]\nnegate: 0\n"
      "occupied_thresh: 0.65\nfree_thresh: 0.196\n",
      t.x(), t.y(), t.z(), R.x(), R.y(), R.z(), R.w(), grid.cell_m, grid.origin.x(), grid.origin.y());
  return text;
}

}  // namespace

void WritePly(const std::filesystem::path& file, const PointCloud& cloud) {
  internal::WriteFile(file, PlyOf(cloud, {}, false));
}

void WritePly(const std::filesystem::path& file, const TriangleMesh& mesh) {
  internal::WriteFile(file, PlyOf(mesh.vertices, mesh.triangles, true));
}

void WriteGrid(const std::filesystem::path& folder, const OccupancyGrid& grid) {
  if (grid.cells.empty()) throw InputError(folder.string() + ": nothing is known at the heights of the grid");
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder.string() + ": can't be made: " + error.message());
  std::string picture =
      "P5\n" + std::to_string(grid.cells.cols) + " " + std::to_string(grid.cells.rows) + "\n255\n";
  for (int y = grid.cells.rows - 1; y >= 0; --y) {
    for (int x = 0; x < grid.cells.cols; ++x) picture.push_back(GreyOf(grid.cells.at<std::int8_t>(y, x)));
  }
  internal::WriteFile(folder / "map.pgm", picture);
  internal::WriteFile(folder / "map.yaml", YamlOf(grid));
}

}  // namespace tutti
