// What the parts of tracking hand to each other.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "frontend/features/features.h"
#include "frontend/map/matcher.h"
#include "frontend/odometry/exposure_estimate.h"
#include "tutti/core/pose.h"

namespace tutti {

/// A frame without pixels.
struct TrackedFrame {
  std::int64_t index = 0;
  double stamp_s = 0;
  std::shared_ptr<const FrameFeatures> features;
  double clock_s = 0;  ///< InputFrame::clock_s
  /// By an IMU: from the axes of the camera in the last frame with a pose to those in this one. Of no use any
  /// more once the frame is tracked, and not saved.
  std::optional<Eigen::Quaterniond> turn = {};

  /// For motions; the stamp is for what others compare frames with.
  double Time() const { return stamp_s + clock_s; }

  template <class Archive>
  void State(Archive& archive) {
    archive(index, stamp_s, features, clock_s);
  }
};

/// A pose of a frame, and what speaks for it.
struct PoseFix {
  explicit PoseFix(const TrackedFrame& f)
      : frame(f), matches{f.features.get(), std::vector<int>(f.features->size(), -1)} {}

  TrackedFrame frame;    ///< its features are aligned with their landmarks
  FrameMatches matches;  ///< of frame.features
  Pose T_camera_world;
  int reference = -1;        ///< keyframe that shares most landmarks with it
  std::vector<int> visible;  ///< landmarks that should be in view
  std::vector<int> found;    ///< those that are, -1 between them
  int inliers = 0;           ///< landmarks that agree with the pose
  bool by_grey = false;      ///< no landmarks: the grey values of the last frame say so
  bool sharp = false;        ///< by grey values, and known to be sharp enough for a keyframe
  std::optional<ExposureEstimate::Misfits> misfits;  ///< if the image says something of its exposure
  std::optional<Vector6d> drift;   ///< of the frames by grey values before it: T = Exp(drift) T_by_grey
  std::optional<Vector6d> motion;  ///< that the rows of a rolling shutter tell: T_later = Exp(motion dt) T

  /// Inliers among the landmarks in view, of which there can't be more than features.
  double Share() const {
    const std::size_t most = std::min(visible.size(), frame.features->size());
    return inliers / std::max(1.0, static_cast<double>(most));
  }
};

constexpr double kVelocityHolds = 1.5;  ///< longer after it, a velocity says nothing [s]
constexpr double kMotionHolds = 0.1;    ///< and nothing of how the camera moves while an image is read [s]

/// The last frame with a pose, and how the camera moved to it: what the next frame is looked for from.
struct LastFrame {
  TrackedFrame frame;
  FrameMatches matches;  ///< of frame.features
  Pose T_camera_world;
  std::optional<Vector6d> velocity;       ///< of T_camera_world, per second: T_now = Exp(v dt) T_last
  std::optional<Vector6d> step;           ///< mean motion from the frame before, as the velocity
  std::optional<Vector6d> mean_velocity;  ///< of the last half second: steps between frames are noisy
  Vector6d motion = Vector6d::Zero();     ///< while it was exposed, by this step and the one before
  Vector6d change = Vector6d::Zero();     ///< of that motion, per second
  ExposureEstimate exposure;
  bool steady = false;                     ///< the velocity before led to where the frame was found
  int reference = -1;                      ///< keyframe that shares most landmarks with it; -1: no frame yet
  int newest_keyframe = -1;                ///< or the one where the frame was found again
  std::int64_t frames_since_keyframe = 0;  ///< 0: it is that keyframe
  int by_grey = 0;                         ///< so many frames in a row were posed by grey values alone

  /// T_camera_world after so many seconds more of its velocity, which it must have.
  Pose After(double seconds) const { return ExpSE3(*velocity * seconds) * T_camera_world; }
  /// The same with a rotation that an IMU measured meanwhile: the camera's centre goes on straight ahead, or
  /// without a velocity stays.
  Pose After(double seconds, const Eigen::Quaterniond& turn) const {
    Eigen::Vector3d center = T_camera_world.Inverse().translation;
    if (velocity) center -= seconds * (T_camera_world.rotation.conjugate() * velocity->head<3>());
    const Eigen::Quaterniond rotation = turn * T_camera_world.rotation;
    return Pose(rotation, -(rotation * center));
  }

  template <class Archive>
  void State(Archive& archive) {
    archive(frame, matches.landmarks, T_camera_world, velocity, step, mean_velocity, motion, change, exposure,
            steady, reference, newest_keyframe, frames_since_keyframe, by_grey);
    if (Archive::kReading) matches.features = frame.features.get();
  }
};

}  // namespace tutti
