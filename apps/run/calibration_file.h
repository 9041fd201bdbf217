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
  std::string format;                  ///< "Kalibr, cam0 of 2", ...: what was read, and assumed; for messages
  std::optional<PinholeCamera> right;  ///< of a raw pair; baseline_m is 0 then
  TransformRows T_right_left{};        ///< with it
  TransformRows T_camera_imu{};        ///< of the camera, or the left one
  double imu_offset_s = 0;             ///< DatasetOptions::time_offset_s
};

/// Reads the calibration of another program: YAML or JSON of Kalibr (camchain: cam0), OpenVINS, ORB-SLAM2 or
/// 3, OpenVSLAM, stella_vslam, VINS, Basalt, OpenCV, ROS (camera_info, as a file or as `ros2 topic echo`
/// prints it), EuRoC (sensor.yaml), KITTI (calib.txt), nerfstudio (transforms.json), Open3D, RealSense, tutti
/// (section `camera:`), or any map with fx, fy, cx, cy; or a table of COLMAP (cameras.txt), DSO, ETH3D and
/// others (calibration_table.h). `pairs`: the right camera, too, where the file has it and says where it is.
/// Throws InputError that names the file, and the key or line, for a missing file, another format, missing or
/// wrong values, and a lens that tutti hasn't got.
Calibration ReadCalibration(const std::filesystem::path& file, bool pairs = false);

/// The calibration that lies in a data set's folder under a usual name (camera.yaml, calibration.yaml,
/// camchain.yaml, ...), if there is one.
std::optional<std::filesystem::path> CalibrationBeside(const std::filesystem::path& folder);

}  // namespace tutti
