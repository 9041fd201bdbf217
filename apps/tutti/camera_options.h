// --calibration, --camera, --fov and --sensor, which several commands have.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "apps/run/recording.h"

namespace tutti::cli {

struct CameraWords {
  std::string calibration, camera, sensor;  ///< as given; empty: not
  double view_deg = 0;
};

void AddCameraOptions(CLI::App& command, CameraWords& words);

/// What was given to this command.
CameraRequest CameraOf(const CLI::App& command, const CameraWords& words);

}  // namespace tutti::cli
