// Measurements of an IMU from files: EuRoC's and TUM-VI's csv, plain text, bags; and what is known of it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
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
  std::vector<std::string> topics;  ///< of a bag that may be it; empty: the file has no topics
  std::optional<Pose> T_body_imu;   ///< EuRoC's T_BS
  ImuCalibration calibration;       ///< T_camera_imu is left to the caller
};

/// In the folder of a data set: mav0/imu0 or imu0 (data.csv, sensor.yaml), imu.csv, imu.txt; in a bag:
/// `topic`, or all of sensor_msgs/Imu. Nothing: there is none. Throws InputError for a damaged sensor.yaml,
/// and a topic that is not there.
std::optional<ImuBeside> FindImu(const std::filesystem::path& dataset, const std::string& topic = "");

/// Its measurements: ReadImuFile, or the bag's messages in the order of the stamps in their headers. Of two
/// topics, one with "gyro" and one with "accel" in its name (RealSense), the angular velocities of the one
/// with the accelerations of the other, by the line through the nearest two. Throws InputError where several
/// topics could be meant; messages that can't be read are left out.
std::vector<ImuSample> ReadImu(const ImuBeside& imu);

/// EuRoC's imu0/sensor.yaml: T_BS, noise densities. Throws InputError with file and line.
void ReadImuYaml(const std::filesystem::path& file, ImuBeside* imu);

}  // namespace tutti
#pragma GCC visibility pop
