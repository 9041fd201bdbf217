// What two images say of the step that another odometry measured between them.
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

}  // namespace tutti
