// How an IMU turned and what it gained of velocity, from its measurements.
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "tutti/core/imu.h"

namespace tutti {

/// Measurements in order of time, and the rotation up to each. Between two the angular velocity changes
/// evenly. Value type.
class GyroTrack {
 public:
  /// Measurements that are not later than those before are left out.
  void Add(const ImuSample& sample);
  /// Measurements of before are not needed any more.
  void ForgetBefore(double stamp_s);

  bool empty() const { return knots_.empty(); }
  double end_s() const { return knots_.back().stamp_s; }

  /// R_from_to in the IMU's axes, by the IMU's stamps. None where it has no measurements, or a gap.
  std::optional<Eigen::Quaterniond> Turned(double from_s, double to_s) const;
  /// The same with a bias taken out.
  std::optional<Eigen::Quaterniond> Turned(double from_s, double to_s, const Eigen::Vector3d& bias) const;

  /// Integral of the accelerations as measured, with gravity, turned into the axes at `from_s` [m/s].
  std::optional<Eigen::Vector3d> VelocityGained(double from_s, double to_s,
                                                const Eigen::Vector3d& gyro_bias) const;

  /// False for numbers from a damaged file.
  bool IsPossible() const;
  /// Mean length of the angular velocities between two times, as they are [rad/s].
  std::optional<double> MeanRate(double from_s, double to_s) const;

  template <class Archive>
  void State(Archive& archive) {
    archive(knots_);
  }

 private:
  struct Knot {
    double stamp_s = 0;
    Eigen::Vector3d gyro = Eigen::Vector3d::Zero();
    Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();  // since the first one
    Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();
    template <class Archive>
    void State(Archive& archive) {
      archive(stamp_s, gyro, turned, acceleration);
    }
  };
  // The last one that is not later; knots_.size(): there is none, or none after it, or a gap follows.
  std::size_t Before(double stamp_s) const;
  // From a measurement on, for some seconds within its interval.
  Eigen::Vector3d Within(std::size_t knot, double from_s, double to_s) const;

  std::deque<Knot> knots_;
};

}  // namespace tutti
