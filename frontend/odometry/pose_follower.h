// Frames whose poses another odometry knows: what they see of the map, and when one becomes a keyframe.
#pragma once

#include <optional>

#include "frontend/odometry/pose_search.h"
#include "frontend/odometry/tracked_frame.h"
#include "tutti/frontend/frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

/// Stands where PoseSearch and KeyframePolicy stand for the odometry's own poses. Value type.
class PoseFollower {
 public:
  PoseFollower(const OdometryOptions& options, const CameraRig& rig)
      : options_(options), rig_(rig), search_(options, rig) {}

  /// Where a frame is in the map, of which the other odometry says T_odom_camera; `T_world_last`: where the
  /// frame before is now, which corrections may have moved. The first frame is where the odometry says.
  Pose Next(const Pose& T_odom_camera, const Pose& T_world_last);
  /// The map around the last frame has become larger by this factor, and steps of the odometry with it.
  void Rescale(double factor) { scale_ *= factor; }
  bool started() const { return T_odom_last_.has_value(); }

  struct Sight {
    PoseFix fix;               ///< landmarks where the pose says they are
    std::vector<int> matched;  ///< per feature of fix.frame: landmarks that look alike, near there; -1: none
  };
  /// What a frame at this pose sees of the landmarks around a keyframe. The pose is not changed.
  Sight See(const Map& map, const TrackedFrame& frame, int keyframe, const Pose& T_camera_world) const;
  /// What the images say of the step from a keyframe (CheckStep). If it is off by so much that landmarks are
  /// not near where they should be, the frame is looked for at the keyframe by what its features look like.
  std::optional<StepCheck> Check(const Map& map, const Sight& sight, int keyframe) const;
  /// By distance in terms of the scene's depth, rotation, and how little of the newest keyframe is in view.
  bool WantsKeyframe(const Map& map, const PoseFix& fix, int newest_keyframe) const;

 private:
  OdometryOptions options_;
  CameraRig rig_;
  PoseSearch search_;
  std::optional<Pose> T_odom_last_;
  double scale_ = 1;  // of the map where the last frame is, by the odometry's unit
};

}  // namespace tutti
