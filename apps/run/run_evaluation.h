// A run against its ground truth.
#pragma once

#include <string>

#include "apps/run/run_result.h"

namespace tutti {

/// How far apart the two ends of each loop are, by trajectory.txt: fills result.loop_errors. EvaluateRun goes
/// over them again with the ground truth.
void MeasureLoops(RunResult& result);

/// Scores both trajectories of the result and judges its loops. Mono: alignment by Sim(3), metric sensors:
/// SE(3). The error of a loop is that of its constraint (in mono scaled by the alignment) against the
/// reference's relative pose. It is false if its translation is off by more than the scene and the path
/// allow, the greatest of 10 % of the median depth of the query's landmarks, 0.5 % of the path between its
/// ends, and 0.05 m; or its rotation by more than 8 deg. Where there is no constraint, the distance of the
/// two places takes the error's place, and the whole median depth that of the 10 %. Where the reference has
/// positions alone, it is by how much the distance of the two places differs from the constraint's. Accepted
/// loops whose ends have no reference (PoseOfFrame) count as neither. Sets result.reference (cut to the run),
/// result.evaluation, result.loop_errors and Loop::correct.
void EvaluateRun(const Trajectory& reference, const std::string& file, RunResult& result);

}  // namespace tutti
