// EuRoC's sensor.yaml: a small, fixed subset of YAML, read with the line numbers that errors need.
#pragma once

#include <filesystem>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti {

/// One camera of an ASL data set.
struct SensorYaml {
  PinholeCamera camera;
  Pose T_body_sensor;  ///< T_BS
  double rate_hz = 20;
};

/// Throws InputError that names file and line for a missing file or key, a wrong number of values, an unknown
/// model.
SensorYaml ReadSensorYaml(const std::filesystem::path& file);

}  // namespace tutti
