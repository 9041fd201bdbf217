// tutti generate --trajectory: a world rendered along a way that is given, with an IMU beside it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/tutti/options.h"
#include "data/synthetic/synthetic_options.h"
#include "tutti/core/imu.h"

namespace tutti::cli {

/// What the command line says of the way; without a trajectory there is none.
struct PathArguments {
  std::string trajectory, lens = "plain";
  std::string imu, imu_file;          // a sensor's name, or measurements; at most one of them
  std::vector<double> T_body_camera;  // 12 or 16 numbers
  double imu_delay_ms = 0;
  std::optional<double> exposure_ms;
};

void AddPathOptions(CLI::App& command, PathArguments& arguments);

/// Sets options.path, and what follows from it. `scene_given`: the command line names the world. Throws
/// InputError.
void SetPath(const PathArguments& arguments, bool scene_given, SyntheticOptions* options);

/// mav0/imu0 of a data set that was rendered along options.path. Returns the number of measurements; 0: no
/// IMU was asked for. Throws InputError.
std::size_t WriteImu(const PathArguments& arguments, const SyntheticOptions& options,
                     const std::filesystem::path& folder);

}  // namespace tutti::cli
