// How probable a loop is, all things considered. Internal.
#pragma once

#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Probability that the image shows the place that geometry has looked at, by logistic regression on
///   logit of the posterior mass around the place (4 graph levels),
///   -log_nfa, 0 to 300: how little chance explains the inliers; more of it says no more.
/// Spread of the motion and coverage of the image were in the regression, too, and add nothing to these two.
/// Its three numbers come from bench/fit_loop_probability: loops of synthetic worlds and changes of real
/// images with seeds that no table is measured on, and of the unchanged real images, which tables show, too
/// (docs/loop-closure.md section 5).
double LoopProbability(const Verification& verification);

}  // namespace tutti::internal
