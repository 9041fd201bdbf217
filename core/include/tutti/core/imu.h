// What an inertial measurement unit (IMU) delivers.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>
#include <mutex>
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

/// Measurements on their way from the thread of an IMU's driver to the frames. Safe to use from several
/// threads.
class ImuBuffer {
 public:
  /// A measurement; those that no frame takes for long are dropped, the oldest first.
  void Push(const ImuSample& sample) {
    constexpr std::size_t kMost = 200000;  // minutes
    const std::lock_guard<std::mutex> lock(mutex_);
    if (samples_.size() == kMost) samples_.pop_front();
    samples_.push_back(sample);
  }

  /// Takes out the measurements up to a stamp [s], oldest first: all since the frame before, for
  /// InputFrame::imu.
  std::vector<ImuSample> TakeUntil(double stamp_s) {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::vector<ImuSample> taken;
    for (; !samples_.empty() && samples_.front().stamp_s <= stamp_s; samples_.pop_front())
      taken.push_back(samples_.front());
    return taken;
  }

 private:
  std::mutex mutex_;
  std::deque<ImuSample> samples_;
};

}  // namespace tutti
#pragma GCC visibility pop
