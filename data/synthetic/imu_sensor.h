// Inertial sensors, and what they measure on a way.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "data/synthetic/pose_spline.h"
#include "tutti/core/imu.h"

namespace tutti::synthetic {

/// A sensor that one can buy. Biases and scale errors are drawn from a seed.
struct ImuSensor {
  std::string name;
  double rate_hz = 200;
  double gyro_noise = 0;                ///< white noise [rad/s/sqrt(Hz)]
  double gyro_random_walk = 0;          ///< [rad/s^2/sqrt(Hz)]
  double gyro_bias = 0;                 ///< standard deviation of the first bias [rad/s]
  double acceleration_noise = 0;        ///< white noise [m/s^2/sqrt(Hz)]
  double acceleration_random_walk = 0;  ///< [m/s^3/sqrt(Hz)]
  double acceleration_bias = 0;         ///< standard deviation of the first bias [m/s^2]
  double scale_error = 0;               ///< standard deviation of the factor of each axis
  double late_s = 0;                    ///< its stamps say so much more than the camera's clock [s]
};

/// bmi055, adis16448 (EuRoC's) or phone. Throws InputError that names them for another name.
ImuSensor ImuSensorOf(const std::string& name);

/// What a sensor on the body measures from the first pose to the last one, stamps as the path has them.
/// Angular velocity and specific force (the acceleration less gravity) in the sensor's axes, with its errors.
/// World z is up. The same seed gives the same bytes.
std::vector<ImuSample> SampleImu(const PoseSpline& path, const ImuSensor& sensor, std::uint64_t seed);

/// The columns of EuRoC's imu0/data.csv.
std::string EurocImuCsv(const std::vector<ImuSample>& samples);
/// EuRoC's imu0/sensor.yaml: the IMU is the body.
std::string EurocImuYaml(const ImuSensor& sensor);

}  // namespace tutti::synthetic
