#include "tutti/backend/evaluation.h"

#include <algorithm>
#include <cmath>

#include "backend/evaluation/evaluation_path.h"
#include "core/angle.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

/// a^-1 b, with the transpose for the inverse of a rotation (as evo does, also where it is not quite one).
PoseMatrix Between(const PoseMatrix& a, const PoseMatrix& b) {
  return {a.rotation.transpose() * b.rotation, a.rotation.transpose() * (b.translation - a.translation)};
}

void AddError(const PoseMatrix& error, PoseErrors& out) {
  const double off = (error.rotation - Eigen::Matrix3d::Identity()).squaredNorm();
  out.translation.push_back(error.translation.norm());
  out.rotation_deg.push_back(internal::kDegrees *
                             LogSO3(Eigen::Quaterniond(error.rotation).normalized()).norm());
  out.full.push_back(std::sqrt(off + error.translation.squaredNorm()));
}

/// The poses with their rotations as written, turned by `rotation`, where there are such.
std::vector<PoseMatrix> Matrices(const AssociatedPoses& poses, bool of_reference,
                                 const std::vector<Eigen::Matrix3d>& written,
                                 const Eigen::Quaterniond& rotation) {
  const std::vector<Pose>& list = of_reference ? poses.reference : poses.estimate;
  std::vector<PoseMatrix> out(list.size());
  for (std::size_t k = 0; k < list.size(); ++k) {
    const std::size_t index = of_reference ? poses.indices[k].first : poses.indices[k].second;
    out[k].translation = list[k].translation;
    out[k].rotation =
        written.empty() ? list[k].rotation.toRotationMatrix() : Eigen::Matrix3d(rotation * written[index]);
  }
  return out;
}

AssociatedPoses Associate(const Trajectory& reference, const Trajectory& estimate,
                          const EvaluationOptions& options) {
  if (options.by_index) return AssociateByIndex(reference, estimate);
  if (options.interpolate)
    return AssociateByInterpolation(reference, estimate, options.max_interpolation_s, options.time_offset_s);
  return AssociateByTime(reference, estimate, options.max_time_difference_s, options.time_offset_s);
}

void RequireOnePerPose(const std::vector<Eigen::Matrix3d>& written, const Trajectory& trajectory) {
  if (!written.empty() && written.size() != trajectory.size())
    throw InputError("evaluation: rotations as written and poses differ in number");
}

}  // namespace

std::string EvaluationOptions::Validate() const {
  if (!(max_time_difference_s >= 0)) return "evaluation: max_time_difference_s must not be negative";
  if (!std::isfinite(time_offset_s)) return "evaluation: time_offset_s must be finite";
  if (!(max_interpolation_s > 0)) return "evaluation: max_interpolation_s must be positive";
  if (interpolate && by_index) return "evaluation: poses without time stamps can't be interpolated";
  if (!vertical.allFinite() || !(vertical.norm() > 0)) return "evaluation: vertical must not be zero";
  if (!(rpe_delta > 0) || !std::isfinite(rpe_delta)) return "evaluation: rpe_delta must be positive";
  if (rpe_unit == DeltaUnit::kFrames && rpe_delta != std::floor(rpe_delta)) {
    return "evaluation: rpe_delta must be a whole number of frames";
  }
  if (rpe_unit == DeltaUnit::kDegrees && rpe_delta > 180 && rpe_all_pairs)
    return "evaluation: no two poses are more than 180 degrees apart; rpe_delta is too large";
  if (rpe_unit == DeltaUnit::kSeconds && by_index)
    return "evaluation: rpe_unit seconds needs time stamps (KITTI: give its times.txt)";
  if (!(rpe_tolerance >= 0)) return "evaluation: rpe_tolerance must not be negative";
  return {};
}

ErrorStatistics Summarize(std::vector<double> errors) {
  ErrorStatistics out;
  out.count = errors.size();
  if (errors.empty()) return out;
  const double n = static_cast<double>(errors.size());
  double sum = 0;
  for (double e : errors) {
    sum += e;
    out.sse += e * e;
  }
  out.mean = sum / n;
  out.rmse = std::sqrt(out.sse / n);
  double squares = 0;
  for (double e : errors) squares += (e - out.mean) * (e - out.mean);
  out.std = std::sqrt(squares / n);
  std::sort(errors.begin(), errors.end());
  const std::size_t middle = errors.size() / 2;
  out.median = errors.size() % 2 == 1 ? errors[middle] : 0.5 * (errors[middle - 1] + errors[middle]);
  out.min = errors.front();
  out.max = errors.back();
  return out;
}

PoseErrors AbsoluteErrors(const std::vector<PoseMatrix>& reference, const std::vector<PoseMatrix>& estimate) {
  PoseErrors out;
  for (std::size_t k = 0; k < reference.size(); ++k) {
    AddError(Between(estimate[k], reference[k]), out);
    // Not through the rotation: it need not be quite one.
    out.translation.back() = (reference[k].translation - estimate[k].translation).norm();
  }
  return out;
}

PoseErrors RelativeErrors(const std::vector<PoseMatrix>& reference, const std::vector<PoseMatrix>& estimate,
                          const std::vector<std::pair<std::size_t, std::size_t>>& pairs) {
  PoseErrors out;
  for (const auto& [i, j] : pairs)
    AddError(Between(Between(reference[i], reference[j]), Between(estimate[i], estimate[j])), out);
  return out;
}

EvaluationReport EvaluateTrajectory(const Trajectory& reference, const Trajectory& estimate,
                                    const EvaluationOptions& options, const RotationsAsWritten& written) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
  RequireOnePerPose(written.reference, reference);
  RequireOnePerPose(written.estimate, estimate);
  EvaluationReport out;
  out.poses = Associate(reference, estimate, options);
  out.pairs = out.poses.indices.size();
  out.reference_poses = reference.size();
  out.estimate_poses = estimate.size();
  out.alignment = options.alignment;
  out.S_reference_estimate = AlignPoses(out.poses, options);
  if (options.alignment != TrajectoryAlignment::kNone) {
    for (Pose& pose : out.poses.estimate) pose = ApplyAlignment(out.S_reference_estimate, pose);
  }
  const std::vector<PoseMatrix> a =
      Matrices(out.poses, true, options.interpolate ? std::vector<Eigen::Matrix3d>() : written.reference,
               Eigen::Quaterniond::Identity());
  const std::vector<PoseMatrix> b =
      Matrices(out.poses, false, written.estimate, out.S_reference_estimate.rotation);
  out.path_length_m = PathLengths(a).back();
  out.absolute = AbsoluteErrors(a, b);
  out.ate = Summarize(out.absolute.translation);
  out.ate_rotation = Summarize(out.absolute.rotation_deg);
  out.ate_full = Summarize(out.absolute.full);
  out.relative_pairs = RelativePairs(out.poses.estimate, out.poses.stamps_s, options);
  out.relative = RelativeErrors(a, b, out.relative_pairs);
  out.rpe = Summarize(out.relative.translation);
  out.rpe_rotation = Summarize(out.relative.rotation_deg);
  out.rpe_full = Summarize(out.relative.full);
  if (options.kitti) {
    out.kitti = EvaluateKitti(a, b);
    out.drift = EvaluateDrift(a, b);
  }
  return out;
}

}  // namespace tutti
