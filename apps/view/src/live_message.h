// The state of a run as the page reads it.
#pragma once

#include <string>

#include "live_state.h"

namespace tutti::view {

/// JSON of the news, one line. The image is a JPEG of at most 640 px as a data URI; tracks are the landmarks
/// of the newest keyframe: their pixels there, and where the pose of this frame puts them.
std::string LiveMessage(const LiveNews& news, const CameraRig& rig);

}  // namespace tutti::view
