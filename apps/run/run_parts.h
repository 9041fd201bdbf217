// What a run and the loop closure on a shared odometry have in common.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/run/run_observer.h"
#include "apps/run/runner.h"
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

/// Of loops to earlier sessions of the same data set (MapSession::note, as NoteOf has written it): the time
/// stamp of the candidate, which has a frame in it.
void CollectStamps(const RunState& state, RunResult& result);

}  // namespace tutti
