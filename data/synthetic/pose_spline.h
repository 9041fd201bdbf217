// A smooth way through poses that were measured at some times: where a body was between them, how it turned
// and how it sped up.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "tutti/core/trajectory.h"

namespace tutti::synthetic {

/// The natural cubic spline of the positions and of the quaternions, which are normalised after it. It goes
/// through every pose, and its accelerations are continuous. Immutable.
class PoseSpline {
 public:
  /// At least three poses whose stamps grow strictly. Throws InputError.
  explicit PoseSpline(const Trajectory& poses);

  double Begin() const { return begin_s_; }               ///< stamp of the first pose [s]
  double Length() const { return knots_.back().time_s; }  ///< from there to the last one [s]

  // Times count from the first pose [s]; before it and after the last one the body stands still.
  Pose At(double time_s) const;  ///< T_world_body
  /// About the axes of the body [rad/s].
  Eigen::Vector3d AngularVelocity(double time_s) const;
  /// In the world [m/s^2].
  Eigen::Vector3d Acceleration(double time_s) const;

 private:
  using Vector7 = Eigen::Matrix<double, 7, 1>;  // position, quaternion (x, y, z, w)
  struct Knot {
    double time_s = 0;
    Vector7 value = Vector7::Zero(), curvature = Vector7::Zero();
  };
  // A value, and its first and second derivative by the time.
  struct Jet {
    Vector7 value, rate, curvature;
  };
  void FindCurvatures();
  Jet JetAt(double time_s) const;

  double begin_s_ = 0;
  std::vector<Knot> knots_;
};

}  // namespace tutti::synthetic
