// Free and occupied space as files of other programs. Both need a library that may not be there.
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

}  // namespace tutti
