// How uncertain another odometry is, by what the images say of its steps.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "tutti/frontend/odometry.h"

namespace tutti {

/// One camera: standard deviation of log(scale) from one keyframe to the next, in the pose graph.
inline constexpr double kOdometrySigmaScale = 0.005;

/// Standard deviations of the random walk that explains by how much the images contradict the odometry's
/// steps. The contradiction over 1, 2, 4, 8 and 16 keyframes is looked at, so that errors which go on for a
/// while (a heading or a scale that is off) count as what they become; the largest of these counts. Medians:
/// steps that the images got wrong do not matter while they are few. No loop has a say, so a false one can't
/// make room for itself.
class OdometryUncertainty {
 public:
  void Add(const StepCheck& check) { checks_.push_back(check); }

  struct Sigmas {
    double fraction = 0;      ///< of a step's translation, as a share of its length, up to 0.05 [1];
                              ///< 0: too few steps
    double rotation_rad = 0;  ///< of its rotation; 0: too few steps
  };
  /// On the worst axis of each.
  Sigmas Estimate() const;

 private:
  Sigmas Over(std::size_t window) const;

  std::vector<StepCheck> checks_;
};

}  // namespace tutti
