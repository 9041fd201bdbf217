#include "apps/run/run_parts.h"

#include <sys/resource.h>

#include <limits>
#include <map>
#include <set>
#include <utility>

#include "core/numbers.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// Keyframes of the map piece that trajectory.txt is of.
void CollectKeyframes(const Odometry& odometry, const FrameRange& session, RunResult& result) {
  const std::vector<std::int64_t> frames = FrameIndices(odometry.map(), -1, session);
  const std::set<std::int64_t> posed(frames.begin(), frames.end());
  Trajectory keyframes;
  result.keyframes = 0;
  for (const int id : odometry.map().KeyframeIds()) {
    const std::int64_t frame = odometry.map().keyframe(id).frame_index;
    if (session.Has(frame)) ++result.keyframes;
    if (posed.count(frame) == 0) continue;
    keyframes.push_back({odometry.map().keyframe(id).stamp_s, odometry.map().keyframe(id).T_world_camera});
  }
  result.keyframe_trajectory = BodyTrajectory(std::move(keyframes), result.rig);
}

// Those of the run's own recording. Time stamps of another recording would mean other frames here.
void CollectLoops(const RunState& state, RunResult& result) {
  result.loops.clear();
  for (const Loop& loop : state.loops) {
    if (loop.query < state.FirstFrame()) continue;
    result.loops.push_back(loop);
    if (loop.candidate < state.FirstFrame())
      result.loops.back().candidate_stamp_s =
          -std::numeric_limits<double>::infinity();  // no frame here has it
  }
}

}  // namespace

double PeakMemoryMb() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

double ProcessCpuSeconds() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

RunConfig WithOverrides(RunConfig config, const RunRequest& request) {
  if (request.no_loops) config.run.loops = false;
  if (request.no_imu) config.dataset.imu = false;
  if (request.follow_s) config.dataset.follow_s = *request.follow_s;
  if (request.start) config.dataset.start = *request.start;
  if (request.end) config.dataset.end = *request.end;
  if (request.stride) config.dataset.stride = *request.stride;
  if (request.threads) config.run.threads = *request.threads;
  if (request.inject_false_loops) config.run.inject_false_loops = *request.inject_false_loops;
  if (request.seed) config.loops.seed = *request.seed;
  const std::string problem = config.run.Validate();
  if (!problem.empty()) throw InputError("--threads: " + problem);
  return config;
}

RunConfig Watched(RunConfig config, const RunRequest& request) {
  for (const auto& observer : request.observers) {
    config.loops.keep_posterior = config.loops.keep_posterior || observer->WantsPosteriors();
    config.loops.keep_evidence = config.loops.keep_evidence || observer->WantsPosteriors();
  }
  return config;
}

std::optional<std::pair<Trajectory, std::string>> ReadReference(const Dataset& dataset,
                                                                const RunRequest& request,
                                                                std::vector<std::string>* warnings) {
  if (request.ground_truth && *request.ground_truth == "none") return std::nullopt;
  const std::optional<fs::path> file =
      request.ground_truth ? request.ground_truth : dataset.GroundTruthFile();
  if (!file) return std::nullopt;
  try {
    Trajectory reference = dataset.ReadGroundTruth(*file, warnings);
    if (!HasRotations(reference) && warnings != nullptr)
      warnings->push_back(file->string() + ": has positions alone; errors of rotation are left out");
    return std::make_pair(std::move(reference), file->string());
  } catch (const InputError& e) {
    const char* hint = " (ground truth; --ground-truth none runs without it)";
    throw InputError(e.what() + std::string(hint));
  }
}

double FrameInterval(const Dataset& dataset) {
  if (dataset.Size() < 2) return 0;
  std::vector<double> intervals;
  for (std::size_t i = 1; i < dataset.Size(); ++i)
    intervals.push_back(dataset.Stamp(i) - dataset.Stamp(i - 1));
  return internal::Median(std::move(intervals)) / static_cast<double>(dataset.Number(1) - dataset.Number(0));
}

const char* DepthSource(Sensor sensor) { return sensor == Sensor::kStereo ? "right" : "depth"; }

Trajectory BodyTrajectory(Trajectory trajectory, const CameraRig& rig) {
  const Pose T_camera_body = rig.T_body_camera.Inverse();
  for (StampedPose& pose : trajectory) pose.pose = pose.pose * T_camera_body;
  return trajectory;
}

void CollectEarlierSessions(const RunState& state, RunResult& result) {
  result.map.value().earlier.assign(state.sessions.size() - 1, {});
  const Pose T_camera_body = result.rig.T_body_camera.Inverse();
  const std::vector<int> pieces = FramePieces(state.odometry->map(), state.Session());
  if (pieces.empty()) return;
  for (const int id : state.odometry->map().KeyframeIds()) {
    const std::int64_t frame = state.odometry->map().keyframe(id).frame_index;
    if (frame >= state.FirstFrame() || state.odometry->map().keyframe(id).piece != pieces.front()) continue;
    const Pose T_world_body = state.odometry->map().keyframe(id).T_world_camera * T_camera_body;
    result.map->earlier[state.SessionOf(frame)].push_back(
        {state.odometry->map().keyframe(id).stamp_s, T_world_body});
    result.map->keyframes[frame] = T_world_body;
  }
}

void CollectStamps(const RunState& state, RunResult& result) {
  const std::vector<MapSession>& sessions = result.map.value().sessions;
  const std::string own = fs::absolute(result.dataset).lexically_normal().string();
  std::map<std::int64_t, double> stamps;  // of keyframes, by frame
  for (const int id : state.odometry->map().KeyframeIds()) {
    const std::int64_t frame = state.odometry->map().keyframe(id).frame_index;
    if (frame < state.FirstFrame() && DatasetOfNote(sessions[state.SessionOf(frame)].note) == own)
      stamps[frame] = state.odometry->map().keyframe(id).stamp_s;
  }
  for (Loop& loop : result.loops) {
    const auto stamp = stamps.find(loop.candidate);
    if (stamp != stamps.end()) loop.candidate_stamp_s = stamp->second;
  }
}

void CollectMap(const RunState& state, RunResult& result) {
  CollectLoops(state, result);
  result.corrections = state.corrections;
  result.appearance_only = state.odometry == nullptr;
  result.peak_memory_mb = PeakMemoryMb();
  if (result.appearance_only) return;
  const Odometry& odometry = *state.odometry;
  const FrameRange session = state.Session();
  result.trajectory = BodyTrajectory(FrameTrajectory(odometry.map(), -1, session), result.rig);
  result.frames_tracked = result.trajectory.size();
  const std::vector<int> pieces = FramePieces(odometry.map(), session);
  result.other_pieces.clear();
  for (std::size_t i = 1; i < pieces.size(); ++i)
    result.other_pieces.push_back(
        BodyTrajectory(FrameTrajectory(odometry.map(), pieces[i], session), result.rig));
  result.in_map = !pieces.empty() && pieces.front() < odometry.LastView().session_piece;
  result.trajectory_odometry = result.trajectory;
  const OdometryReport report = odometry.Report();
  result.stereo_row_error_px = report.stereo_row_error_px;
  result.stereo_matches = report.stereo_matches;
  result.lens = report.lens;
  result.clocks = report.clocks;
  result.height = report.height;
  if (result.imu && report.imu) {  // what the file shows, and what the images say
    const ImuReport file = *std::exchange(result.imu, report.imu);
    result.imu->samples = file.samples;
    result.imu->rate_hz = file.rate_hz;
    result.imu->duration_s = file.duration_s;
    result.imu->missing_share = file.missing_share;
    result.imu->longest_gap_s = file.longest_gap_s;
    result.imu->acceleration_mps2 = file.acceleration_mps2;
    result.imu->noise = file.noise;
  }
  result.map_figures = MeasureMap(odometry, session);
  CollectKeyframes(odometry, session, result);
}

}  // namespace tutti
