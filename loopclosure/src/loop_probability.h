// How probable a loop is, all things considered. Internal.
#pragma once

#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Probability that the image shows the place that geometry has looked at, by logistic regression on
///   logit of the posterior mass around the place (4 graph levels),
///   ln(1 - log_nfa): how little chance explains the inliers,
///   ln(motion_spread + 0.001): true pairs are mostly seen from near by, so that their inliers move alike.
/// Its four numbers come from bench/fit_loop_probability, from pairs of real, changed and synthetic images
/// that no table is measured on (docs/loop-closure.md section 5).
double LoopProbability(const Verification& verification);

}  // namespace tutti::internal
