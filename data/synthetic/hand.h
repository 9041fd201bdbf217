// The shaking of a camera in a hand.
#pragma once

#include <array>
#include <cstdint>

#include "tutti/core/pose.h"

namespace tutti::synthetic {

/// Turns about the camera's axes (each a sum of sinusoids of 0.5 to 1.3 Hz) in bursts with calm moments
/// between them, first at time 0. The camera sits on a lever, as one in a hand turns about the wrist.
/// Immutable.
class Hand {
 public:
  /// `peak_deg_per_s`: the fastest turning about each axis [deg/s]; 0: a steady hand.
  Hand(std::uint64_t seed, double peak_deg_per_s);
  /// T_steady_shaken: the camera as it is, in the frame of the camera of a steady hand.
  Pose At(double time_s) const;

 private:
  static constexpr int kWaves = 3;
  struct Axis {
    std::array<double, kWaves> frequency_hz, phase, amplitude;
    double scale = 0;  // of all of them [rad]
  };
  double Burst(double time_s) const;
  double Angle(const Axis& axis, double time_s) const;

  double peak_;               // [rad/s]
  double period_s_ = 1;       // from burst to burst
  std::array<Axis, 3> axes_;  // x, y, z of the camera
};

}  // namespace tutti::synthetic
