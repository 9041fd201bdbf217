// Calibrations as tables of words and numbers, not keys: COLMAP, DSO, ETH3D and others. Internal.
#pragma once

#include <string>

#include "apps/run/calibration_file.h"

namespace tutti {

/// Reads COLMAP's cameras.txt, what `rs-enumerate-devices -c` prints of one stream, DSO's camera.txt, a line
/// "fx fy cx cy [k1 k2 p1 p2 [k3]]" (ETH3D, DROID-SLAM), or a camera matrix of 3x3, 3x4 or 4x4 values
/// (ScanNet, Stray Scanner). Nothing for other texts. Throws InputError, which names file and line, for a
/// camera that tutti has not.
std::optional<Calibration> ReadCalibrationTable(const std::filesystem::path& file, const std::string& text);

}  // namespace tutti
