// Camera calibrations as other programs write them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tutti/core/camera.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// One camera, and what the file says beside it. Zeros: it doesn't say.
struct Calibration {
  PinholeCamera camera;                ///< width and height 0 where the file leaves them out
  double baseline_m = 0;               ///< distance of the right camera of a rectified pair
  double rate_hz = 0;                  ///< frames a second
  double depth_units_per_m = 0;        ///< value of one metre in depth images
  std::string format;                  ///< "Kalibr", "ORB-SLAM", "OpenCV", ..., for messages
  std::optional<PinholeCamera> right;  ///< of a raw pair; baseline_m is 0 then
  TransformRows T_right_left{};        ///< with it
};

/// Reads a YAML file of Kalibr (camchain: cam0), ORB-SLAM2 or 3, OpenCV, ROS (camera_info), EuRoC
/// (sensor.yaml) or tutti (section `camera:`). `pairs`: the right camera, too, where Kalibr (cam1 with
/// T_cn_cnm1), ORB-SLAM3 (Camera2 with Stereo.T_c1_c2) or tutti have one. Throws InputError that names the
/// file, and the key or line, for a missing file, another format, missing or wrong values, and a lens model
/// that tutti hasn't got.
Calibration ReadCalibration(const std::filesystem::path& file, bool pairs = false);

/// The calibration that lies in a data set's folder under a usual name (camera.yaml, calibration.yaml,
/// camchain.yaml, ...), if there is one.
std::optional<std::filesystem::path> CalibrationBeside(const std::filesystem::path& folder);

}  // namespace tutti
