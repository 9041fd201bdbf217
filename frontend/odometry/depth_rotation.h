// How far a camera turned between two depth images, by their surfaces alone.
#pragma once

#include <optional>

#include "frontend/features/features.h"
#include "frontend/geometry/rolling_shutter.h"
#include "tutti/core/pose.h"

namespace tutti {

/// A rotation and how well it is known.
struct DepthRotation {
  Eigen::Vector3d rotation_rad =
      Eigen::Vector3d::Zero();  ///< Exp of it takes the first camera's axes to the second's
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< of it, the translation being free [1/rad^2]
};

/// A depth image in short, and how the camera moved (MotionPrior) while its rows were read.
struct MovingDepth {
  const DepthGrid& grid;
  const Vector6d& motion;
};

/// Where the second of two depth images was taken.
struct DepthAlignment {
  Pose T_second_first;
  /// Of a left perturbation (translation, rotation): what the surfaces and the prior say. A plane leaves
  /// three directions to the prior.
  Matrix6d information = Matrix6d::Zero();
};

/// Aligns the points of one depth grid with the surfaces of the next (point to plane, each point with the
/// surface that the camera sees in its direction: Y. Chen, G. Medioni, "Object Modelling by Registration of
/// Multiple Range Images", 1992), at the times of their middle rows, from about `T_second_first`.
/// `inverse_sigma`: of inverse depth [1/m]. `prior`: information of `T_second_first`. None where too little
/// is seen in both.
std::optional<DepthAlignment> AlignDepth(const RollingShutter& shutter, const MovingDepth& first,
                                         const MovingDepth& second, const Pose& T_second_first,
                                         const Matrix6d& prior, double inverse_sigma);

/// The rotation alone, without a prior.
std::optional<DepthRotation> RotationByDepth(const RollingShutter& shutter, const MovingDepth& first,
                                             const MovingDepth& second, const Pose& T_second_first,
                                             double inverse_sigma);

}  // namespace tutti
