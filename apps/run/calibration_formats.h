// Readers of the calibrations that SLAM and odometry programs write, one for each format. Internal.
#pragma once

#include "apps/run/calibration_file.h"
#include "apps/run/calibration_keys.h"

namespace tutti {

/// For messages.
constexpr const char* kKnownCalibrations =
    "the formats that are known are those of Kalibr, ORB-SLAM, OpenVSLAM and stella_vslam, VINS, Basalt, "
    "OpenCV, ROS (camera_info), EuRoC, KITTI, COLMAP (cameras.txt), nerfstudio (transforms.json), Open3D, "
    "RealSense, DSO, tutti (camera: fx), and a line of fx fy cx cy";

/// The camera of these keys, its frame rate and its depth scale. `format` is for messages.
Calibration OneCamera(const CalibrationKeys& keys, const std::string& format);

/// Adds the right camera of raw pairs. Throws InputError for a distance that can't be in metres.
void SetRight(const CalibrationKeys& keys, const PinholeCamera& right, const Pose& T_right_left,
              Calibration& out);

/// Throws InputError for a camera that no image can have; `which`: "right ", or "".
void CheckCalibrated(const std::filesystem::path& file, PinholeCamera camera, const char* which = "");

/// cam0, cam1, ... of Kalibr's camchain and of OpenVINS, as far as they are cameras.
std::vector<std::string> CamerasOfChain(const CalibrationDocument& file);

/// Each throws InputError that names file, line and key for what is missing, and for a lens that tutti hasn't
/// got. @{
Calibration FromChain(const CalibrationDocument& file);
Calibration FromOrbSlam(const CalibrationDocument& file);  ///< flat keys: ORB-SLAM2 and 3, OpenVSLAM
Calibration FromStella(const CalibrationDocument& file);   ///< stella_vslam's sections
Calibration FromVins(const CalibrationDocument& file);     ///< a camera, or the settings that name its file
Calibration FromBasalt(const CalibrationDocument& file);
/// @}

}  // namespace tutti
