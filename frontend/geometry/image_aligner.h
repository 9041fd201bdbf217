// How a camera moved, by the grey values of its images alone: for images too blurred to show corners.
//
// C. Forster, M. Pizzoli, D. Scaramuzza, "SVO: Fast Semi-Direct Monocular Visual Odometry", ICRA 2014 (sparse
// image alignment), on coarse images, as G. Klein and D. Murray, "Improving the Agility of Keyframe-Based
// SLAM", ECCV 2008, do; and each image blurred once more by the other's motion, so that both are blurred
// alike (P. Liu, X. Zuo, V. Larsson, M. Pollefeys, "MBA-VO: Motion Blur Aware Visual Odometry", ICCV 2021,
// blur the sharp one).
#pragma once

#include <array>
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
  Vector6d change = Vector6d::Zero();  ///< of the motion, per second

  /// T_then_now: `seconds` later.
  Pose Then(double seconds) const { return ExpSE3((motion + 0.5 * seconds * change) * seconds); }
  /// Starts from a time that is `time` later.
  Pose Then(double time, double seconds) const {
    return ExpSE3((motion + (time + 0.5 * seconds) * change) * seconds);
  }
};

/// Immutable.
class ImageAligner {
 public:
  explicit ImageAligner(const CameraRig& rig) : camera_(rig.camera), shutter_(rig) {}

  /// Places of an earlier frame that are known in the world.
  struct Reference {
    const FrameFeatures* features = nullptr;
    CameraMotion camera;
    std::vector<double> depth;     ///< of each feature [m]; 0: not known
    double since_s = 0;            ///< the reference was taken so long before [s]
    std::optional<Vector6d> step;  ///< mean motion from the frame before to the reference
  };

  /// Where the camera is that sees `seen` (features as the image has them), from about `start`, so that the
  /// places look as in the reference. Both images are exposed for `exposure_s`. None if they do not, or if an
  /// image is not there any more. With a rolling shutter `prior` holds the motion, which else goes on
  /// changing as it did from `start.motion`, that between the two frames before.
  std::optional<CameraMotion> Align(const Reference& reference, const FrameFeatures& seen,
                                    const CameraMotion& start, const MotionPrior& prior,
                                    double exposure_s) const;

  /// Exposures that Misfits compares [s].
  static constexpr int kExposures = 9;
  static double Exposure(int i) { return 0.005 * i; }
  /// Square differences of the grey values, by their contrast, if the images were exposed so long. All zero:
  /// that can't be told.
  std::array<double, kExposures> Misfits(const Reference& reference, const FrameFeatures& seen,
                                         const CameraMotion& camera) const;

 private:
  class Level;
  struct Point;
  struct Streak;
  void MoveOn(const Reference& from, CameraMotion* reference, CameraMotion* now) const;
  std::vector<Point> PointsOf(const Reference& reference) const;
  PinholeCamera camera_;
  RollingShutter shutter_;
};

}  // namespace tutti
