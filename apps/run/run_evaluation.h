// A run against its ground truth.
#pragma once

#include <string>

#include "apps/run/run_result.h"

namespace tutti {

/// Scores both trajectories of the result and judges its accepted loops. Mono: alignment by Sim(3), a loop is
/// false if the reference's positions are more than 10 m apart. Metric sensors: SE(3), a loop is false if its
/// transform differs from the reference's relative pose by more than 0.20 m or 8 deg. Everything else that
/// was accepted is true; loops whose ends have no reference (PoseOfFrame) count as neither. Sets
/// result.reference (cut to the run), result.evaluation and LoopRecord::correct.
void EvaluateRun(const Trajectory& reference, const std::string& file, RunResult& result);

}  // namespace tutti
