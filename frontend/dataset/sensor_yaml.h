// EuRoC's sensor.yaml: a small, fixed subset of YAML, read with the line numbers that errors need.
#pragma once

#include <filesystem>
#include <optional>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

#pragma GCC visibility push(default)  // of `tutti run --calibration`, too
namespace tutti {

/// One camera of an ASL data set.
struct SensorYaml {
  PinholeCamera camera;
  std::optional<Pose> T_body_sensor;  ///< T_BS, where the file has it
  std::optional<double> rate_hz;
};

/// Throws InputError that names file and line for a missing file or key, a wrong number of values, an unknown
/// model.
SensorYaml ReadSensorYaml(const std::filesystem::path& file);

}  // namespace tutti
#pragma GCC visibility pop
