// How probable a loop is, all things considered. Internal.
#pragma once

#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// Probability that the image shows the place that geometry has looked at, by logistic regression on
///   logit of Verification::mass, the posterior around the place against a new place,
///   -log_nfa, 0 to 300: how little chance explains the inliers; more of it says no more.
/// The inliers' share of the matches, spread of the motion, coverage of the image, the inliers as a share of
/// those with the image before, and how many images before and after agree were in the regression, too, and
/// add nothing to these two. Its three numbers come from bench/fit_loop_probability: of loops whose motion
/// geometry knows, by the detector before this fit, in synthetic worlds and changes of real images with seeds
/// that no table is measured on, and in the unchanged real images, which tables show, too
/// (docs/loop-closure.md section 5).
double LoopProbability(const Verification& verification);

}  // namespace tutti::internal
