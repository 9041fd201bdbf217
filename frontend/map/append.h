// A map that another recording or another map joins: its keyframes in the pixels of another camera, and the
// keyframes of two maps in one.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tutti/frontend/frame.h"
#include "tutti/frontend/map.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// True if what a map knows of pixels is the same for both: size, focal lengths, principal point, baseline.
bool SameCamera(const CameraRig& a, const CameraRig& b);

/// Why a map that was made with one rig can't be gone on with by the other; empty if it can. `scales`: of the
/// image pyramid.
std::string OtherCameraProblem(const CameraRig& map, const CameraRig& session,
                               const std::vector<float>& scales);

/// The map for frames that another rig takes. Images are rectified, so a pixel u of the one camera is
/// K' K^-1 u of the other; depths stay. A corner's pyramid level is the one that has its size in the new
/// pixels. Self-calibration leaves keyframes of another camera alone (FrameFeatures::other_camera). Throws
/// InputError for another kind of sensor, or a focal length that is too different.
Map WithRig(const Map& map, const CameraRig& rig);

/// Appends another map, which stands apart: its keyframes, submaps and landmarks get numbers after those that
/// are there, its frames this offset. Its camera may be another one (WithRig). Throws InputError as WithRig
/// does, and for another image pyramid; `map` is then as it was.
void Append(const Map& other, std::int64_t frame_offset, Map* map);

}  // namespace tutti
#pragma GCC visibility pop
