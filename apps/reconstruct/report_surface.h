// A dense surface in the report of the run that its map is of.
#pragma once

#include <filesystem>

#include "tutti/dense/dense_map.h"

namespace tutti {

/// Puts the surface, thinned to what a browser draws quickly, into the folder's report.json and the 3D tab of
/// its report.html, where it replaces an older one. False if there is no such report, or one of an older
/// version. Throws InputError if a file is damaged or can't be written.
bool ShowInReport(const std::filesystem::path& folder, const TriangleMesh& surface);

/// Vertices of each cell of a lattice become one, their mean, with cells so large that at most `most`
/// vertices are left; triangles between fewer than three cells are left out. Normals are not kept.
TriangleMesh Thinned(const TriangleMesh& surface, std::size_t most);

}  // namespace tutti
