// Time stamps of a data set's images.
#pragma once

#include <filesystem>
#include <vector>

namespace tutti::cli {

/// The first number of every line [s], increasing: TUM's rgb.txt, KITTI's times.txt, EuRoC's data.csv (whole
/// nanoseconds). Lines that begin with # are left out. Throws InputError that names file and line.
std::vector<double> ReadFrameStamps(const std::filesystem::path& file);

}  // namespace tutti::cli
