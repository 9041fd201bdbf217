// How a camera in a hand moves, and what it sees while it moves: shaking, exposure and readout.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "data/synthetic/rasterizer.h"
#include "tutti/core/camera.h"
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

/// Rows are exposed for `exposure_s`, the last one `readout_s` after the first (a rolling shutter; 0: all at
/// once).
struct Shutter {
  double exposure_s = 0;  ///< [s]
  double readout_s = 0;   ///< [s]
  int samples = 1;        ///< of the exposure, an odd number
};

/// What a camera sees at a time [s]. The camera may be a part of the whole one: some of its rows.
using View = std::function<Rendering(const PinholeCamera& rows, double time_s)>;

/// The mean of what is seen over the exposure, strip of rows by strip of rows. `time_s`: the middle of the
/// exposure of the middle row. Depth is that of the middle of each strip's exposure.
Rendering Expose(const PinholeCamera& camera, const Shutter& shutter, double time_s, const View& view);

/// The camera that sees rows first..first + rows - 1 alone.
PinholeCamera RowsOf(const PinholeCamera& camera, int first, int rows);

}  // namespace tutti::synthetic
