// A camera that reads its rows one after the other: what it saw, as if all rows were read with the middle
// one.
//
// C. Kerl, J. Stueckler, D. Cremers, "Dense Continuous-Time Tracking and Mapping with Rolling Shutter RGB-D
// Cameras", ICCV 2015, gives the model; here the motion is constant while one image is read.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "frontend/features/features.h"
#include "frontend/geometry/pose_solver.h"
#include "tutti/frontend/frame.h"

namespace tutti {

/// What is known of how a camera moves before its image says. Motions are those of T_camera_world, per
/// second: T_camera_world(t + s) = Exp(motion s) T_camera_world(t) [m/s, rad/s].
struct MotionPrior {
  Vector6d motion = Vector6d::Zero();
  Vector6d sigma = Vector6d::Ones();  ///< standard deviation of each
  /// If known, how the camera moved at an earlier frame: the step from there is what the mean of both motions
  /// makes.
  double since_s = 0;  ///< that frame; 0: not known [s]
  Pose T_camera_world_before;
  Vector6d motion_before = Vector6d::Zero();
  Vector6d mean_sigma = Vector6d::Ones();

  /// Adds it to equations whose first unknowns are a left perturbation of the pose, and the motion.
  template <int N>
  void Add(const Pose& pose, const Vector6d& now, internal::NormalEquations<N>* equations) const {
    for (Eigen::Index i = 0; i < 6; ++i) {
      const double weight = 1 / (sigma(i) * sigma(i)), r = now(i) - motion(i);
      equations->hessian(6 + i, 6 + i) += weight;
      equations->gradient(6 + i) += weight * r;
      equations->cost += weight * r * r;
    }
    if (!(since_s > 0)) return;
    const Vector6d mean = LogSE3(pose * T_camera_world_before.Inverse()) / since_s;
    const Vector6d off = mean - 0.5 * (now + motion_before);
    for (Eigen::Index i = 0; i < 6; ++i) {
      const double weight = 1 / (mean_sigma(i) * mean_sigma(i)), by_pose = 1 / since_s, by_motion = -0.5;
      equations->hessian(i, i) += weight * by_pose * by_pose;
      equations->hessian(i, 6 + i) += weight * by_pose * by_motion;
      equations->hessian(6 + i, i) += weight * by_pose * by_motion;
      equations->hessian(6 + i, 6 + i) += weight * by_motion * by_motion;
      equations->gradient(i) += weight * by_pose * off(i);
      equations->gradient(6 + i) += weight * by_motion * off(i);
      equations->cost += weight * off(i) * off(i);
    }
  }
};

/// Immutable. Motions are MotionPrior's.
class RollingShutter {
 public:
  explicit RollingShutter(const CameraRig& rig)
      : camera_(rig.camera), readout_s_(rig.readout_s), depth_delay_s_(rig.depth_delay_s) {}

  /// False: a global shutter, and depth of the same time.
  bool Rolls() const { return readout_s_ > 0 || depth_delay_s_ != 0; }
  /// True if the rows tell how the camera moves (Refine).
  bool RowsTell() const { return readout_s_ > 0; }
  const PinholeCamera& camera() const { return camera_; }
  /// When a row is read, counted from the middle row [s].
  double TimeOf(double row) const { return readout_s_ * (row / (camera_.height - 1) - 0.5); }

  /// Features as the camera would have seen them at the time of the middle row: keypoints and depths, of
  /// which a depth image is asked where they were in it when it was taken. `seen`: as the image has them.
  /// `depth`: of features without a measured one [m].
  std::shared_ptr<const FrameFeatures> Straighten(const FrameFeatures& seen, const Vector6d& motion,
                                                  double depth) const;

  /// Pose at the time of the middle row, and the motion meanwhile, from where landmarks are in the image as
  /// it was read. Robust, as RefinePose. `motion` starts from the prior's. Returns the number of inliers.
  int Refine(const std::vector<PointObservation>& observations, const MotionPrior& prior,
             Pose* T_camera_world, Vector6d* motion, std::vector<char>* inlier) const;

 private:
  // Inverse depth of a pixel when its row is read (`ray`: of depth 1), from an image that was taken where the
  // camera was moved by `T_taken_row`; 0 and negative: as DepthImage::InverseAt.
  double InverseDepth(const DepthImage& depth, const Eigen::Vector3d& ray, double first_m,
                      const Pose& T_taken_row, int rounds) const;
  void TakeDepth(const FrameFeatures& seen, const Vector6d& motion, double first_m, FrameFeatures* out) const;

  PinholeCamera camera_;
  double readout_s_, depth_delay_s_;
};

}  // namespace tutti
