// What an inertial measurement unit says of itself, and what images say of it.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/imu.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Something that can't be right: the measured figure, and what to do. One sentence each.
struct ImuFinding {
  std::string measured;  ///< what was seen
  std::string advice;    ///< what to do about it
};

/// What an examination on the way found. By the camera's clock, as all stamps below.
struct ImuMoment {
  double stamp_s = 0;                                   ///< of the newest frame [s]
  double residual_deg = 0;                              ///< as in ImuReport
  double time_offset_s = 0;                             ///< the same
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();  ///< the same
};

/// How the camera and the gyroscope turned from one frame to the next.
struct ImuTurn {
  double stamp_s = 0;       ///< of the later frame [s]
  double camera_deg_s = 0;  ///< [deg/s]
  double gyro_deg_s = 0;    ///< without the bias [deg/s]
  double apart_deg = 0;     ///< between the two rotations [deg]
};

/// Where up is by the accelerometer, over some seconds.
struct ImuTilt {
  std::int64_t frame = 0;                         ///< number of a frame in their middle
  double stamp_s = 0;                             ///< its stamp [s]
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< unit vector, in the map's frame of reference
};

/// Noise of an IMU at rest by the Allan deviation (IEEE Std 952-1997, annex C): the deviation of means over
/// tau seconds from those before them, of the worst axis.
struct ImuNoise {
  double rest_s = 0;                 ///< how long the IMU did not move [s]
  std::vector<double> tau_s;         ///< ascending [s]
  std::vector<double> gyro;          ///< for each tau [rad/s]
  std::vector<double> acceleration;  ///< the same [m/s^2]
  double gyro_density = 0;           ///< of white noise [rad/s/sqrt(Hz)]
  double acceleration_density = 0;   ///< the same [m/s^2/sqrt(Hz)]
};

/// Result of an examination. Zeros: not measured.
struct ImuReport {
  std::uint64_t samples = 0;
  double rate_hz = 0;             ///< by the median interval [1/s]
  double duration_s = 0;          ///< from the first to the last [s]
  double missing_share = 0;       ///< of the measurements that the rate would give [0..1]
  double longest_gap_s = 0;       ///< [s]
  double acceleration_mps2 = 0;   ///< median length, in the unit of the file
  std::optional<ImuNoise> noise;  ///< none: it did not rest for ten seconds

  // What the turning of a camera says of the gyroscope.
  std::uint64_t steps = 0;  ///< from frame to frame, compared
  double turned_deg = 0;    ///< by the camera, over all of them [deg]
  double agreement = 0;     ///< share of the camera's turning that the gyroscope explains [0..1]
  double residual_deg = 0;  ///< root mean square of what it does not explain of a step [deg]
  std::optional<Eigen::Quaterniond>
      R_camera_imu;                ///< mounting; none: it has not turned enough about two axes
  double mounting_sigma_deg = 0;   ///< standard deviation, worst axis [deg]
  double time_offset_s = 0;        ///< added to the IMU's stamps gives the camera's clock [s]
  double time_offset_sigma_s = 0;  ///< standard deviation [s]
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();  ///< in the IMU's axes [rad/s]
  std::vector<ImuMoment> moments;                       ///< what was found on the way, every 50 frames
  std::vector<ImuTurn> turns;                           ///< the newest 1200 of the steps

  // What the accelerometer says of the map, if it says it to a degree.
  std::optional<Eigen::Vector3d> up;  ///< unit vector against gravity, in the map's frame of reference
  double up_sigma_deg = 0;            ///< standard deviation of an axis [deg]
  double gravity_mps2 = 0;            ///< length of gravity, as measured [m/s^2]
  Eigen::Vector3d acceleration_bias = Eigen::Vector3d::Zero();  ///< in the IMU's axes [m/s^2]
  std::vector<ImuTilt> tilts;                                   ///< every second
  double metres = 0;        ///< one camera: that the unit of its map has; 0: not known
  double metres_sigma = 0;  ///< standard deviation, as a share of it [1]

  /// The map's unit is known well enough to be used, to 2 %.
  bool KnowsMetres() const { return metres > 0 && metres_sigma < 0.02; }

  bool trusted = false;              ///< it agrees with the camera, and its mounting and offset are known
  std::vector<ImuFinding> findings;  ///< empty: nothing speaks against it
};

/// "IMU: 200 Hz, 82.3 s, mounting from sensor.yaml": one line about measurements that were found.
std::string ImuText(const ImuReport& report);

}  // namespace tutti
#pragma GCC visibility pop
