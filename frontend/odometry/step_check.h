// What images say of steps: of those that another odometry measured, and of those that one camera made with
// few landmarks.
#pragma once

#include <optional>
#include <vector>

#include "tutti/frontend/frame.h"
#include "tutti/frontend/map.h"
#include "tutti/frontend/odometry.h"
#include "tutti/frontend/odometry_options.h"

namespace tutti {

/// The step from a keyframe to a frame at `T_camera_world`, which shows `landmarks` (one per feature, -1 for
/// none), against the pose that fits best what both see, which is looked for around `T_seen_world`. With
/// depth, points are where the keyframe alone saw them; with one camera, where the map has them. Nothing if
/// too few points agree on one pose.
std::optional<StepCheck> CheckStep(const Map& map, const CameraRig& rig, const OdometryOptions& options,
                                   int keyframe, const FrameFeatures& features,
                                   const std::vector<int>& landmarks, const Pose& T_camera_world,
                                   const Pose& T_seen_world);

/// One camera. Whether images contradict the map where it was thin not long before a keyframe, or began
/// there. Few landmarks can hold a wrong pose; what is triangulated from it agrees with it and holds the next
/// one, a world that gets smaller and smaller as the camera moves on. Matches that no landmark has chosen
/// don't agree with it: the essential matrix that fits them has many more inliers than the one of the map's
/// poses. False where the map was not thin, or images say nothing.
bool ImagesContradict(const Map& map, const PinholeCamera& camera, int keyframe, int min_inliers);

}  // namespace tutti
