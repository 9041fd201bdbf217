// What a dense map becomes beside PLY files and grids: free and occupied space for other programs, with
// libraries that may not be there, and a surface in the report of its run.
#pragma once

#include <filesystem>

#include "tutti/dense/dense_map.h"

namespace tutti {

/// Throw InputError, with the name of the package, if this tutti was built without OctoMap (OpenVDB).
void RequireOctomap();
void RequireOpenVdb();

/// Writes OctoMap's binary tree (.bt; A. Hornung et al., "OctoMap", Autonomous Robots 2013), in the map
/// frame. Throws InputError.
void WriteOctomap(const std::filesystem::path& file, const OccupiedSpace& space);

/// Writes the distance of each known cell to the border of the nearest occupied one [m], negative inside, as
/// the float grid "esdf" of OpenVDB, whose transform leads to the map frame. Throws InputError.
void WriteEsdf(const std::filesystem::path& file, const OccupiedSpace& space);

/// Puts the surface, thinned to what a browser draws quickly, into the folder's report.json and the 3D tab of
/// its report.html, where it replaces an older one. False if there is no such report, or one of an older
/// version. Throws InputError if a file is damaged or can't be written.
bool ShowInReport(const std::filesystem::path& folder, const TriangleMesh& surface);

/// Vertices of each cell of a lattice become one, their mean, with cells so large that at most `most`
/// vertices are left; triangles between fewer than three cells are left out. Normals are not kept.
TriangleMesh Thinned(const TriangleMesh& surface, std::size_t most);

}  // namespace tutti
