// The clocks of an RGB-D camera, by what its images say: how long it reads rows, and when it took depth.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "frontend/geometry/rolling_shutter.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry.h"

namespace tutti {

/// Many uncertain measurements of one number.
class Measurements {
 public:
  void Add(double value, double sigma) { all_.emplace_back(value, sigma); }
  /// Robust mean, with the standard deviation that their scatter tells; 0 and infinity for too few.
  std::pair<double, double> Mean() const;

 private:
  std::vector<std::pair<double, double>> all_;
};

/// Fed with each tracked frame of a camera that is taken to have a global shutter and depth of the same time;
/// what it is of its own is seen while it turns.
/// Readout: landmarks that a resting camera has made are, in a fast frame, off by readout * tau * u' (u': how
/// fast their pixels move, tau: -1/2 in the first row to 1/2 in the last), of which the pose explains a part
/// alone. Depth's delay d: between two depth images the camera turns by what it turned between two colour
/// images d earlier; where its turning changes by g, that is d g less (the time that correlates two turning
/// rates best: J. Kelly and G. Sukhatme, ISER 2010).
class ClockEstimate {
 public:
  ClockEstimate(const CameraRig& rig, const OdometryOptions& options);

  /// `seen`: the frame as the image has it. `last`: what the tracker makes of it. `keyframe`: its id if it
  /// has become one, or -1.
  void Add(const Map& map, const TrackedFrame& seen, const PoseFix& fix, const LastFrame& last, int keyframe);
  /// The frame before was lost, or none.
  void Break();
  /// Nothing for other sensors.
  std::optional<ClocksFound> Found() const;

 private:
  struct Step {
    Vector6d motion;     // from the frame before, per second
    double dt = 0;       // since then [s]
    double later_s = 0;  // of depth
    std::shared_ptr<const DepthGrid> depth;
  };
  void MeasureReadout(const Map& map, const PoseFix& fix, const Vector6d& motion);
  void MeasureDelay();

  bool readout_wanted_, measures_;
  RollingShutter shutter_;
  PinholeCamera camera_;
  double inverse_sigma_;
  std::deque<Step> steps_;
  std::optional<PoseFix> before_;  // the newest, whose motion the next one tells
  int keyframe_before_ = -1;
  double time_s_ = 0;                // of the newest
  std::map<int, Vector6d> motions_;  // of keyframes, as LastFrame::motion
  Measurements readout_, delay_;
};

}  // namespace tutti
