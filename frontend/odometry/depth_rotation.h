// How far a camera turned between two depth images, by their surfaces alone.
#pragma once

#include <optional>

#include "frontend/features/features.h"
#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti {

/// A rotation and how well it is known.
struct DepthRotation {
  Eigen::Vector3d rotation_rad =
      Eigen::Vector3d::Zero();  ///< Exp of it takes the first camera's axes to the second's
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  ///< of it, the translation being free [1/rad^2]
};

/// Aligns the points of one depth grid with the surfaces of the next (point to plane, each point with the
/// surface that the camera sees in its direction: G. Blais and M. Levine 1995, Y. Chen and G. Medioni 1992),
/// from about `T_second_first`. `inverse_sigma`: of inverse depth [1/m]. None where too little is seen in
/// both.
std::optional<DepthRotation> RotationByDepth(const PinholeCamera& camera, const DepthGrid& first,
                                             const DepthGrid& second, const Pose& T_second_first,
                                             double inverse_sigma);

}  // namespace tutti
