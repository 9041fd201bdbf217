#include "apps/run/run_evaluation.h"

#include <algorithm>
#include <cmath>

#include "core/angle.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr double kMaxDifference = 0.01;        // of time stamps [s], as evo
constexpr double kMonoFalseDistance = 10.0;    // [m]
constexpr double kMetricFalseDistance = 0.20;  // [m]
constexpr double kMetricFalseAngle = 8.0;      // [deg]

TrajectoryScore Score(const Trajectory& reference, const Trajectory& estimate, bool with_scale) {
  TrajectoryScore score;
  if (estimate.empty()) {
    score.reason = "no frame has a pose";
    return score;
  }
  EvaluationOptions options;
  options.alignment = with_scale ? TrajectoryAlignment::kSim3 : TrajectoryAlignment::kSE3;
  options.max_time_difference_s = kMaxDifference;
  try {
    const EvaluationReport report = EvaluateTrajectory(reference, estimate, options);
    score.valid = true;
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

enum class Verdict { kTrue, kFalse, kUnknown };

Verdict Judge(const LoopRecord& loop, const Trajectory& reference, const RunResult& result) {
  const double interval_s = result.frame_interval_s;
  const CameraRig& rig = result.rig;
  const std::optional<Pose> candidate = PoseOfFrame(reference, loop.candidate_stamp_s, interval_s);
  const std::optional<Pose> query = PoseOfFrame(reference, loop.query_stamp_s, interval_s);
  if (!candidate || !query) return Verdict::kUnknown;
  if (rig.sensor == Sensor::kMono || !loop.S_candidate_query) {
    const double distance = (candidate->translation - query->translation).norm();
    return distance > kMonoFalseDistance ? Verdict::kFalse : Verdict::kTrue;
  }
  const Pose T_candidate_query = (*candidate * rig.T_body_camera).Inverse() * (*query * rig.T_body_camera);
  const Pose difference = T_candidate_query.Inverse() * loop.S_candidate_query->RigidPart();
  const bool wrong = difference.translation.norm() > kMetricFalseDistance ||
                     difference.Angle() * internal::kDegrees > kMetricFalseAngle;
  return wrong ? Verdict::kFalse : Verdict::kTrue;
}

}  // namespace

void EvaluateRun(const Trajectory& reference, const std::string& file, RunResult& result) {
  RunEvaluation evaluation;
  const bool mono = result.rig.sensor == Sensor::kMono;
  evaluation.file = file;
  evaluation.alignment = mono ? "sim3" : "se3";
  if (!result.appearance_only) {
    evaluation.slam = Score(reference, result.trajectory, mono);
    evaluation.odometry = Score(reference, result.trajectory_odometry, mono);
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
  }
  for (LoopRecord& loop : result.loops) {
    if (!loop.accepted) continue;
    switch (Judge(loop, reference, result)) {
      case Verdict::kTrue:
        ++evaluation.loops_true;
        loop.correct = true;
        break;
      case Verdict::kFalse:
        ++evaluation.loops_false;
        loop.correct = false;
        break;
      case Verdict::kUnknown:
        ++evaluation.loops_unknown;
        break;
    }
  }
  result.evaluation = evaluation;
}

}  // namespace tutti
