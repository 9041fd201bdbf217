// What an inertial measurement unit (IMU) delivers.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/pose.h"

#pragma GCC visibility push(default)
namespace tutti {

/// One measurement, in the IMU's own axes.
struct ImuSample {
  double stamp_s = 0;                                      ///< time stamp [s]
  Eigen::Vector3d gyro = Eigen::Vector3d::Zero();          ///< angular velocity [rad/s]
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  ///< with gravity: at rest upwards [m/s^2]
};

/// What is known of an IMU; all of it may be absent.
struct ImuCalibration {
  std::optional<Pose> T_camera_imu;     ///< IMU -> camera of the rectified images
  double time_offset_s = 0;             ///< added to the IMU's stamps gives the camera's clock [s]
  double gyro_noise = 0;                ///< white noise [rad/s/sqrt(Hz)]; 0: not known
  double gyro_random_walk = 0;          ///< of the bias [rad/s^2/sqrt(Hz)]; 0: not known
  double acceleration_noise = 0;        ///< white noise [m/s^2/sqrt(Hz)]; 0: not known
  double acceleration_random_walk = 0;  ///< of the bias [m/s^3/sqrt(Hz)]; 0: not known
};

}  // namespace tutti
#pragma GCC visibility pop
