// What is at the same pixel wherever the camera goes: a rim, a burnt-in text,
// parts of the robot. Internal.
#pragma once

#include <vector>

#include "loopclosure/geometry/verification.h"

namespace tutti::internal {

/// True for a match whose ends are less than `static_px` apart: nothing moved
/// there.
bool StaysAtItsPixel(const VerifiedMatch& match, double static_px);

/// Share of the features (of all sets; where the two views differ, of the one
/// with fewer) that lie apart from these matches: in cells of an 8x6 grid over
/// the image that hold none of them, nor do the cells around. Near 0 where the
/// camera stands as it stood: it sees the same everywhere. Large where only a
/// part of the image is the same whatever lies behind it. 0 without features.
double ShareApart(const std::vector<VerifiedMatch>& matches, const View& query, const View& candidate);

}  // namespace tutti::internal
