// Dense maps as files of other programs.
#pragma once

#include <filesystem>

#include "tutti/dense/dense_map.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Writes a binary little-endian PLY (Stanford polygon format): x y z [m], nx ny nz (float), red green blue
/// (uchar), in the world of the poses; and the triangles of a mesh. A file is there in full, or what was
/// there before stays. Throws InputError if it can't be written.
void WritePly(const std::filesystem::path& file, const PointCloud& cloud);
void WritePly(const std::filesystem::path& file, const TriangleMesh& mesh);

/// Writes map.pgm and map.yaml into the folder, which is made if it is missing, as ROS's map_server reads
/// them (https://wiki.ros.org/map_server): 254 free, 0 occupied, 205 unknown; the picture's last row has the
/// least y. Comments of map.yaml say where the world of the poses lies. Throws InputError if a file can't be
/// written.
void WriteGrid(const std::filesystem::path& folder, const OccupancyGrid& grid);

}  // namespace tutti
#pragma GCC visibility pop
