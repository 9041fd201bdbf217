// Measurements of an IMU from files: EuRoC's and TUM-VI's csv, plain text; and what is known of the IMU.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "tutti/core/imu.h"

#pragma GCC visibility push(default)  // of the commands, too
namespace tutti {

/// Lines of seven numbers or more: time stamp, angular velocity (x, y, z), acceleration (x, y, z); parted by
/// commas or blanks, '#' comments. The stamps' unit is told by their size. They are given as the file has
/// them, in its order and units: what is wrong with them, ImuExamination says. Throws InputError with file
/// and line for what is no such line, and for fewer than two.
std::vector<ImuSample> ReadImuFile(const std::filesystem::path& file);

/// An IMU that lies beside the images of a data set.
struct ImuBeside {
  std::filesystem::path file;
  std::optional<Pose> T_body_imu;  ///< EuRoC's T_BS
  ImuCalibration calibration;      ///< T_camera_imu is left to the caller
};

/// In the folder of a data set: mav0/imu0 or imu0 (data.csv, sensor.yaml), imu.csv, imu.txt. Nothing: there
/// is none. Throws InputError for a damaged sensor.yaml.
std::optional<ImuBeside> FindImu(const std::filesystem::path& folder);

/// EuRoC's imu0/sensor.yaml: T_BS, noise densities. Throws InputError with file and line.
void ReadImuYaml(const std::filesystem::path& file, ImuBeside* imu);

}  // namespace tutti
#pragma GCC visibility pop
