// What a run and the loop closure on a shared odometry have in common.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/run/runner.h"
#include "tutti/backend/evaluation.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// Peak of the process so far, resident [MB].
double PeakMemoryMb();
/// Processor time of all threads so far [s].
double ProcessCpuSeconds();

/// The configuration with what the command line says. Throws InputError.
RunConfig WithOverrides(RunConfig config, const RunRequest& request);
/// With the posteriors and the evidence kept if an observer looks at them; they decide nothing.
RunConfig Watched(RunConfig config, const RunRequest& request);

/// The ground truth and its file; nothing if there is none, or none is wanted. Throws InputError.
std::optional<std::pair<Trajectory, std::string>> ReadReference(const Dataset& dataset,
                                                                const RunRequest& request,
                                                                std::vector<std::string>* warnings);

/// Median time from one image of the data set to the next [s], of those between which none is left out by
/// DatasetOptions::stride; 0 for fewer than two.
double FrameInterval(const Dataset& dataset);

/// What distances are measured from beside the image: "right" or "depth".
const char* DepthSource(Sensor sensor);

/// T_world_camera -> T_world_body, the frame that ground truth is of.
Trajectory BodyTrajectory(Trajectory trajectory, const CameraRig& rig);

/// Loops, trajectories, keyframes and memory of a finished run. trajectory_odometry is the trajectory.
void CollectMap(const RunState& state, RunResult& result);

/// Keyframes of the recordings that the map held before, by result.map->sessions, for pictures.
void CollectEarlierSessions(const RunState& state, RunResult& result);

/// Sets the candidate's time stamp of loops to earlier sessions of the same data set (MapSession::note, as
/// NoteOf has written it): a frame there has it.
void CollectStamps(const RunState& state, RunResult& result);

/// How trajectories of a run are evaluated: aligned by Sim(3) or SE(3), time stamps within 0.01 s.
EvaluationOptions EvaluationWith(bool scale);

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
