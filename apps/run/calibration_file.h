// Camera calibrations as other programs write them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tutti/core/camera.h"

namespace tutti {

/// One camera, and what the file says beside it. Zeros: it doesn't say.
struct Calibration {
  PinholeCamera camera;          ///< width and height 0 where the file leaves them out
  double baseline_m = 0;         ///< distance of the right camera of a rectified pair
  double rate_hz = 0;            ///< frames a second
  double depth_units_per_m = 0;  ///< value of one metre in depth images
  std::string format;            ///< "Kalibr", "ORB-SLAM", "OpenCV", ..., for messages
};

/// Reads a YAML file of Kalibr (camchain: cam0), ORB-SLAM2 or 3, OpenCV, ROS (camera_info), EuRoC
/// (sensor.yaml) or tutti (section `camera:`). Throws InputError that names the file, and the key or line,
/// for a missing file, another format, missing or wrong values, and a lens model that tutti hasn't got.
Calibration ReadCalibration(const std::filesystem::path& file);

/// The calibration that lies in a data set's folder under a usual name (camera.yaml, calibration.yaml,
/// camchain.yaml, ...), if there is one.
std::optional<std::filesystem::path> CalibrationBeside(const std::filesystem::path& folder);

}  // namespace tutti
