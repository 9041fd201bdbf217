// What is known of somebody else's odometry that the map follows: what it says of itself, and what the images
// say of it.
#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "apps/slam/odometry_jumps.h"
#include "apps/slam/odometry_uncertainty.h"
#include "tutti/core/camera.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/slam_options.h"

namespace tutti {

/// Not saved, as a map of such an odometry is not.
class FollowedOdometry {
 public:
  using Sigmas = OdometryUncertainty::Sigmas;

  FollowedOdometry(const SlamOptions& options, Sensor sensor);

  /// Its next pose.
  void Add(const StampedPose& T_odom_camera) {
    begun_ = true;
    watch_.Add(T_odom_camera);
  }
  /// Where its poses jump, as far as that is new. `all`: no pose follows.
  std::vector<OdometryJump> TakeJumps(bool all) { return watch_.Take(all); }
  /// Whether the images see the motion of such a step, which led to this keyframe: then it is none.
  bool ImagesConfirm(int keyframe, const OdometryJump& jump) const;
  void NoteJump(const OdometryJump& jump) { jumps_.push_back(jump); }
  /// Those that were noted.
  const std::vector<OdometryJump>& jumps() const { return jumps_; }
  /// Whether there is one.
  bool begun() const { return begun_; }
  /// Whether the images tell of each step how good it is. Not those of one camera: landmarks stand where the
  /// odometry put them, and what is wrong goes on over many steps (of a truth with 0.03 deg between
  /// keyframes, kitti_00_head says 0.3).
  bool ImagesJudgeSteps() const { return begun_ && sensor_ != Sensor::kMono; }

  /// What the images say of the step to a new keyframe. How uncertain that step is by this, if it is: where
  /// one step differs, it may be the images that are wrong (a car that drives along), unless they are known
  /// to be better than the odometry, or differ by far more than it should.
  std::optional<MotionSigma> NoteStep(int keyframe, const StepCheck& check);
  /// It says how uncertain its motion since the last call is, which led to this position, and to this
  /// keyframe if it is not -1. How uncertain all the motion since the keyframe before is, if it led to one.
  std::optional<MotionSigma> NoteMotion(int keyframe, const MotionSigma& sigma,
                                        const Eigen::Vector3d& position);
  /// How often it said how uncertain a motion from keyframe to keyframe is.
  int motions() const { return motions_; }

  /// Between two keyframes: by itself (the mean), else as configured; and by the images.
  Sigmas Stated() const;
  Sigmas Seen() const { return images_.Estimate(); }
  /// What every motion has at least, beside what it says of single ones: what the images say of all of them,
  /// and, if it says nothing, what is configured.
  Sigmas Least() const;
  /// Where the images say more than it does: in plain words, what counts instead; else empty.
  std::string Warning() const;

 private:
  Sigmas configured_;
  Sensor sensor_;
  bool begun_ = false;
  OdometryUncertainty images_;
  std::map<int, StepCheck> checks_;  // by keyframe
  JumpWatch watch_;
  std::vector<OdometryJump> jumps_;
  MotionSigma since_keyframe_, between_keyframes_;
  std::optional<Eigen::Vector3d> keyframe_;  // the last one's position
  double way_m2_ = 0;                        // sum of squares between keyframes
  int motions_ = 0;                          // between keyframes
};

}  // namespace tutti
