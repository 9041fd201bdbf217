// How probable a loop is, all things considered. Internal.
#pragma once

#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Probability that the image shows the place that geometry has accepted, from the posterior mass around that
/// place and from what the inliers are worth (docs/loop-closure.md section 5).
double LoopProbability(const Verification& verification);

}  // namespace tutti::internal
