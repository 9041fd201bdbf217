// The state of a run as the page reads it.
#pragma once

#include <string>

#include "apps/view/live_state.h"

namespace tutti::view {

/// JSON of the news, one line. The image is a JPEG of at most 640 px as a data URI; tracks are some of the
/// landmarks that the frame shows: their pixels in that image, newest first (TracksOf).
std::string LiveMessage(const LiveNews& news);

}  // namespace tutti::view
