#include "tutti/slam/trajectory_closer.h"

#include <map>
#include <mutex>
#include <optional>
#include <string>

#include "apps/slam/trajectory_correction.h"
#include "tutti/core/error.h"
#include "tutti/slam/slam_system.h"

namespace tutti {

RunConfig FollowingConfig(RunConfig config) {
  config.run.global_adjustment = config.run.global_adjustment && config.run.adjust_given;
  return config;
}

class TrajectoryCloser::Impl {
 public:
  Impl(const RunConfig& config, const CameraRig& rig)
      : slam_(FollowingConfig(config), rig),
        T_body_camera_(rig.T_body_camera),
        T_camera_body_(rig.T_body_camera.Inverse()) {}

  TrackResult Push(const InputFrame& frame, const Pose& T_odom_body,
                   const std::optional<MotionSigma>& sigma) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!(frame.stamp_s > last_s_.value_or(frame.stamp_s - 1)))
      throw InputError("frame " + std::to_string(frame.index) +
                       ": its time stamp does not grow; push images in order of time");
    if (T_odom_body.rotation.coeffs().isZero(0))
      throw InputError("frame " + std::to_string(frame.index) +
                       ": its pose has no rotation; the odometry must have more than positions");
    TrackResult result = slam_.Follow(frame, T_odom_body * T_body_camera_, sigma);
    last_s_ = frame.stamp_s;
    if (result.state != TrackingState::kTracking) return result;
    T_map_body_ = result.T_world_camera * T_camera_body_;
    T_odom_body_ = T_odom_body;
    if (result.keyframe >= 0) of_keyframe_[result.keyframe] = {frame.stamp_s, T_odom_body};
    return result;
  }

  void Finish() {
    const std::lock_guard<std::mutex> lock(mutex_);
    slam_.Finish();
    if (slam_.odometry() == nullptr) return;
    const Trajectory frames = FrameTrajectory(slam_.odometry()->map());
    if (!frames.empty()) T_map_body_ = frames.back().pose * T_camera_body_;
  }

  Pose T_map_odom() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return T_map_body_ * T_odom_body_.Inverse();
  }

  Trajectory Corrected(const Trajectory& odometry) const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::vector<OdometryJump> jumps = FindJumps(odometry);
    Trajectory before;
    const SlamReport report = slam_.Report();
    if (report.corrections > 0 || report.global_adjustments > 0) {
      for (const auto& [id, pose] : of_keyframe_) before.push_back(pose);
    }
    return CorrectTrajectory(odometry, before, before.empty() ? before : KeyframesNow(), jumps);
  }

  Trajectory Keyframes() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return KeyframesNow();
  }
  std::vector<Loop> Loops() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return slam_.loops();
  }
  PoseGraph Graph() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return slam_.Graph();
  }
  int Corrections() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return slam_.Report().corrections;
  }
  std::vector<std::string> TakeWarnings() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return slam_.TakeWarnings();
  }

 private:
  Trajectory KeyframesNow() const {
    Trajectory now;
    for (const auto& [id, odom] : of_keyframe_)
      now.push_back({odom.stamp_s, slam_.odometry()->map().keyframe(id).T_world_camera * T_camera_body_});
    return now;
  }

  mutable std::mutex mutex_;
  SlamSystem slam_;
  Pose T_body_camera_, T_camera_body_;
  std::optional<double> last_s_;
  Pose T_map_body_, T_odom_body_;           // of the newest image
  std::map<int, StampedPose> of_keyframe_;  // T_odom_body
};

TrajectoryCloser::TrajectoryCloser(const RunConfig& config, const CameraRig& rig)
    : impl_(std::make_unique<Impl>(config, rig)) {}
TrajectoryCloser::~TrajectoryCloser() = default;
TrackResult TrajectoryCloser::Push(const InputFrame& frame, const Pose& T_odom_body,
                                   const std::optional<MotionSigma>& sigma) {
  return impl_->Push(frame, T_odom_body, sigma);
}
void TrajectoryCloser::Finish() { impl_->Finish(); }
Pose TrajectoryCloser::T_map_odom() const { return impl_->T_map_odom(); }
Trajectory TrajectoryCloser::Corrected(const Trajectory& odometry) const {
  return impl_->Corrected(odometry);
}
Trajectory TrajectoryCloser::Keyframes() const { return impl_->Keyframes(); }
std::vector<Loop> TrajectoryCloser::Loops() const { return impl_->Loops(); }
PoseGraph TrajectoryCloser::Graph() const { return impl_->Graph(); }
int TrajectoryCloser::Corrections() const { return impl_->Corrections(); }
std::vector<std::string> TrajectoryCloser::TakeWarnings() { return impl_->TakeWarnings(); }

}  // namespace tutti
