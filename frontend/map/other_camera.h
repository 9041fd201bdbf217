// A map that another camera goes on with: what its keyframes saw, in the pixels of the new camera.
#pragma once

#include <string>

#include "frontend/map/map.h"
#include "tutti/frontend/frame.h"

namespace tutti {

/// True if what a map knows of pixels is the same for both: size, focal lengths, principal point, baseline.
bool SameCamera(const CameraRig& a, const CameraRig& b);

/// Why a map that was made with one rig can't be gone on with by the other; empty if it can. `scales`: of the
/// image pyramid.
std::string OtherCameraProblem(const CameraRig& map, const CameraRig& session,
                               const std::vector<float>& scales);

/// Appends all keyframes and landmarks of `from`, which `camera` has seen, to an empty map of another camera.
/// Images are rectified, so a pixel u of the one is K' K^-1 u of the other; depths stay. A corner's pyramid
/// level is the one that has its size in the new pixels. Self-calibration leaves such keyframes alone
/// (FrameFeatures::other_camera).
void CarryOver(const Map& from, const PinholeCamera& camera, const PinholeCamera& to_camera, Map* to);

}  // namespace tutti
