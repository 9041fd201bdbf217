// Loop closure for the odometry that a program already has.
//
//   TrajectoryCloser closer(config, rig);
//   for (each image) {
//     closer.Push(frame, T_odom_body);
//     Pose T_map_body = closer.T_map_odom() * T_odom_body;   // of the newest pose
//   }
//   closer.Finish();
//   Trajectory corrected = closer.Corrected(odometry);
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/odometry.h"
#include "tutti/slam/config.h"
#include "tutti/slam/loop.h"

#pragma GCC visibility push(default)
namespace tutti {

/// The configuration of a run that follows another odometry: without the bundle adjustment of the whole map
/// after loops, which would replace the odometry's shape by that of the images, unless run.adjust_given.
RunConfig FollowingConfig(RunConfig config);

/// Keyframes, loops and pose graph around someone else's odometry (VIO, wheels, LiDAR, ...): poses and images
/// go in, the correction comes out. Safe to use from several threads at once; what a pose and an image do
/// enters a fixed number of images later, so the result does not depend on threads or load. Poses should be
/// in metres; one camera's landmarks are triangulated at their scale.
class TrajectoryCloser {
 public:
  /// Throws InputError if the configuration does not fit the rig. Without calibration there are only loops.
  TrajectoryCloser(const RunConfig& config, const CameraRig& rig);
  ~TrajectoryCloser();
  TrajectoryCloser(const TrajectoryCloser&) = delete;
  TrajectoryCloser& operator=(const TrajectoryCloser&) = delete;

  /// The next image and the odometry's pose at its time; in order of time. T_odom_body: the body is what
  /// CameraRig::T_body_camera says. `sigma`: how uncertain the odometry's motion since the last image is;
  /// without it run.odometry_sigma_fraction and odometry_sigma_deg say. Throws InputError for a pose that is
  /// not finite, a sigma below 0 or not finite and a time that does not grow; nothing has happened then.
  TrackResult Push(const InputFrame& frame, const Pose& T_odom_body,
                   const std::optional<MotionSigma>& sigma = {});
  /// After the last image: brings in all that is on its way.
  void Finish();

  /// As REP-105 has it: maps the odometry's world to the corrected one, at the newest image. Identity before
  /// the first one, and without calibration. It jumps when loops close; the odometry never does.
  Pose T_map_odom() const;
  /// A trajectory of the odometry (all its poses, those without images too) as the loops correct it so far.
  /// Single poses that are off get poses between their neighbours.
  Trajectory Corrected(const Trajectory& odometry) const;
  /// The keyframes as they are now, T_map_body.
  Trajectory Keyframes() const;
  /// Every proposed loop so far (a copy), in the order of the queries.
  std::vector<Loop> Loops() const;
  /// Keyframes, edges of the odometry and accepted loops.
  PoseGraph Graph() const;
  /// How often loops moved the trajectory.
  int Corrections() const;
  /// What went wrong without stopping it since the last call, and, after Finish, whether the images show that
  /// the odometry is less certain than configured. Where it jumps (a pose that is off, a restart): some 20
  /// images later; such a step has no weight.
  std::vector<std::string> TakeWarnings();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tutti
#pragma GCC visibility pop
