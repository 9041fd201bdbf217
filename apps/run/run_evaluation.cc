// A run against its ground truth.
#include <algorithm>
#include <cmath>

#include "apps/run/run_parts.h"
#include "core/numbers.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr double kMaxDifference = 0.01;  // of time stamps [s], as evo
constexpr double kDepthShare = 0.1;      // of the median depth, that a true loop's constraint may be off
constexpr double kPathShare = 0.005;     // of the path between its ends, the same
constexpr double kLeastAllowed = 0.05;   // [m]; references are not better
constexpr double kFalseAngle = 8.0;      // [deg]

TrajectoryScore Score(const Trajectory& reference, const Trajectory& estimate, bool with_scale) {
  TrajectoryScore score;
  if (estimate.empty()) {
    score.reason = "no frame has a pose";
    return score;
  }
  try {
    const EvaluationReport report = EvaluateTrajectory(reference, estimate, EvaluationWith(with_scale));
    score.valid = true;
    score.rotations = report.rotations;
    score.poses = report.pairs;
    score.alignment = report.S_reference_estimate;
    score.scale = score.alignment.scale;
    score.ate = report.ate;
    score.ate_rotation = report.ate_rotation;
    score.rpe = report.rpe;
    score.kitti = report.kitti;
  } catch (const InputError& e) {
    score.reason = e.what();
  }
  return score;
}

// Along the poses between two times.
double PathBetween(const Trajectory& trajectory, double begin_s, double end_s) {
  double path = 0;
  const StampedPose* before = nullptr;
  for (const StampedPose& pose : trajectory) {
    if (pose.stamp_s < begin_s || pose.stamp_s > end_s) continue;
    if (before != nullptr) path += (pose.pose.translation - before->pose.translation).norm();
    before = &pose;
  }
  return path;
}

double Extent(const Trajectory& trajectory) {
  if (trajectory.empty()) return 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const StampedPose& pose : trajectory) sum += pose.pose.translation;
  const auto count = static_cast<double>(trajectory.size());
  double squares = 0;
  for (const StampedPose& pose : trajectory) squares += (pose.pose.translation - sum / count).squaredNorm();
  return std::sqrt(squares / count);
}

LoopError Apart(const Pose& candidate, const Pose& query, bool rotations = true) {
  LoopError apart;
  apart.distance_m = (candidate.translation - query.translation).norm();
  if (rotations) apart.angle_deg = (candidate.Inverse() * query).Angle() * internal::kDegrees;
  return apart;
}

// Whether a loop is right, if the ground truth can tell; `scale`: metres in a unit of the map, if known.
std::optional<bool> Judge(const Loop& loop, const Trajectory& reference, std::optional<double> scale,
                          const RunResult& result, LoopError& error) {
  const CameraRig& rig = result.rig;
  const std::optional<Pose> candidate =
      PoseOfFrame(reference, loop.candidate_stamp_s, result.frame_interval_s);
  const std::optional<Pose> query = PoseOfFrame(reference, loop.query_stamp_s, result.frame_interval_s);
  if (!candidate || !query) return std::nullopt;
  const Pose candidate_camera = *candidate * rig.T_body_camera, query_camera = *query * rig.T_body_camera;
  error = Apart(candidate_camera, query_camera, HasRotations(reference));
  if (!scale) return std::nullopt;
  const auto found = result.map_figures.depth.find(loop.query);
  const double depth = found == result.map_figures.depth.end() ? 0 : *scale * found->second;
  const double path = PathBetween(reference, loop.candidate_stamp_s, loop.query_stamp_s);
  const double by_path = std::max(kLeastAllowed, kPathShare * path);
  if (!loop.S_candidate_query) return error.distance_m <= std::max(by_path, depth);
  if (!HasRotations(reference)) {  // the distances of the two places alone can be compared
    error.error_m = std::abs(*scale * loop.S_candidate_query->translation.norm() - error.distance_m);
    return error.error_m <= std::max(by_path, kDepthShare * depth);
  }
  Pose constraint = loop.S_candidate_query->RigidPart();
  constraint.translation *= *scale;
  const Pose difference = (candidate_camera.Inverse() * query_camera).Inverse() * constraint;
  error.error_m = difference.translation.norm();
  error.error_deg = difference.Angle() * internal::kDegrees;
  return error.error_m <= std::max(by_path, kDepthShare * depth) && error.error_deg <= kFalseAngle;
}

}  // namespace

EvaluationOptions EvaluationWith(bool scale) {
  EvaluationOptions options;
  options.alignment = scale ? TrajectoryAlignment::kSim3 : TrajectoryAlignment::kSE3;
  options.max_time_difference_s = kMaxDifference;
  return options;
}

void MeasureLoops(RunResult& result) {
  result.loop_errors.clear();
  for (const Loop& loop : result.loops) {
    const auto pose = [&](double stamp_s) {
      return PoseOfFrame(result.trajectory, stamp_s, result.frame_interval_s);
    };
    const std::optional<Pose> candidate = pose(loop.candidate_stamp_s), query = pose(loop.query_stamp_s);
    const Pose& T_body_camera = result.rig.T_body_camera;
    result.loop_errors.push_back(
        candidate && query ? Apart(*candidate * T_body_camera, *query * T_body_camera) : LoopError());
  }
}

void EvaluateRun(const Trajectory& reference, const std::string& file, RunResult& result) {
  RunEvaluation evaluation;
  const bool mono = result.rig.sensor == Sensor::kMono;
  evaluation.file = file;
  evaluation.alignment = mono ? "sim3" : "se3";
  if (!result.appearance_only) {
    evaluation.slam = Score(reference, result.trajectory, mono);
    evaluation.odometry = Score(reference, result.trajectory_odometry, mono);
    if (!mono) evaluation.scaled = Score(reference, result.trajectory, true);
  }
  if (!result.trajectory.empty()) {
    const double first = result.trajectory.front().stamp_s, last = result.trajectory.back().stamp_s;
    for (const StampedPose& pose : reference) {
      if (pose.stamp_s < first - kMaxDifference || pose.stamp_s > last + kMaxDifference) continue;
      if (!result.reference.empty()) {
        evaluation.path_m += (pose.pose.translation - result.reference.back().pose.translation).norm();
      }
      result.reference.push_back(pose);
    }
    evaluation.extent_m = Extent(result.reference);
  }
  MeasureLoops(result);
  std::optional<double> scale = 1.0;
  if (mono) scale = evaluation.slam.valid ? std::optional<double>(evaluation.slam.scale) : std::nullopt;
  for (std::size_t i = 0; i < result.loops.size(); ++i) {
    Loop& loop = result.loops[i];
    const std::optional<bool> correct = Judge(loop, reference, scale, result, result.loop_errors[i]);
    if (!loop.accepted()) continue;
    loop.correct = correct;
    ++(!correct ? evaluation.loops_unknown : *correct ? evaluation.loops_true : evaluation.loops_false);
  }
  result.evaluation = evaluation;
}

}  // namespace tutti
