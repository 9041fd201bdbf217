// How a camera moved, by the grey values of its images alone: for images too blurred to show corners.
//
// C. Forster, M. Pizzoli, D. Scaramuzza, "SVO: Fast Semi-Direct Monocular Visual Odometry", ICRA 2014 (sparse
// image alignment), on coarse images, where blur is small, as G. Klein and D. Murray, "Improving the Agility
// of Keyframe-Based SLAM", ECCV 2008, do.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "frontend/features/features.h"
#include "frontend/geometry/rolling_shutter.h"
#include "tutti/frontend/frame.h"

namespace tutti {

/// Where a camera is and how it moves. Motion: as MotionPrior.
struct CameraMotion {
  Pose T_camera_world;
  Vector6d motion = Vector6d::Zero();
};

/// Immutable.
class ImageAligner {
 public:
  explicit ImageAligner(const CameraRig& rig) : camera_(rig.camera), shutter_(rig) {}

  /// Places of an earlier frame that are known in the world.
  struct Reference {
    const FrameFeatures* features = nullptr;
    Pose T_camera_world;
    std::vector<double> depth;  ///< of each feature [m]; 0: not known
  };

  /// Where the camera is that sees `seen` (features as the image has them), from about `start`, so that the
  /// places look as in the reference. None if they do not, or if an image is not there any more.
  /// `start.sigma`: holds the motion.
  std::optional<CameraMotion> Align(const Reference& reference, const FrameFeatures& seen,
                                    const CameraMotion& start, const MotionPrior& prior) const;

 private:
  class Level;
  PinholeCamera camera_;
  RollingShutter shutter_;
};

}  // namespace tutti
