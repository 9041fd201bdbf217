#include "tutti/backend/evaluation.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/numbers.h"
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

/// The poses, and their rotations as written where there are such, that are to be paired.
struct Kept {
  Trajectory trajectory;
  std::vector<Eigen::Matrix3d> written;

  void Only(const std::vector<std::size_t>& indices) {
    const auto chosen = [&](const auto& list) {
      std::decay_t<decltype(list)> out;
      for (const std::size_t k : indices) out.push_back(list[k]);
      return out;
    };
    trajectory = chosen(trajectory);
    if (!written.empty()) written = chosen(written);
  }
};

Kept Keep(const Trajectory& trajectory, const std::vector<Eigen::Matrix3d>& written,
          const EvaluationOptions& options) {
  Kept out{trajectory, written};
  if (options.downsample > 0) out.Only(EvenlySpacedPoses(trajectory.size(), options.downsample));
  if (options.motion_filter) out.Only(MovedPoses(out.trajectory, *options.motion_filter));
  return out;
}

AssociationStatistics StatisticsOf(const AssociatedPoses& poses, const Trajectory& reference,
                                   const Trajectory& estimate, const EvaluationOptions& options) {
  std::vector<double> differences;
  std::vector<bool> paired_r(reference.size()), paired_e(estimate.size());
  for (const auto& [r, e] : poses.indices) {
    paired_r[r] = paired_e[e] = true;
    differences.push_back(std::abs(reference[r].stamp_s - estimate[e].stamp_s - options.time_offset_s));
  }
  AssociationStatistics out;
  out.reference_unmatched = static_cast<std::size_t>(std::count(paired_r.begin(), paired_r.end(), false));
  out.estimate_unmatched = static_cast<std::size_t>(std::count(paired_e.begin(), paired_e.end(), false));
  if (options.by_index || options.interpolate) return out;
  const ErrorStatistics statistics = Summarize(std::move(differences));
  out.median_time_difference_s = statistics.median;
  out.largest_time_difference_s = statistics.max;
  return out;
}

void Project(ProjectionPlane plane, std::vector<Pose>& poses, std::vector<PoseMatrix>& matrices) {
  for (std::size_t k = 0; k < poses.size(); ++k) {
    matrices[k] = ProjectToPlane(matrices[k], plane);
    poses[k] = Pose(Eigen::Quaterniond(matrices[k].rotation), matrices[k].translation);
  }
}

/// Poses of the estimate that are in no pair, though the reference has poses before and after them.
std::size_t Unpaired(const AssociatedPoses& poses, const Trajectory& reference, const Trajectory& estimate,
                     const EvaluationOptions& options) {
  std::vector<bool> paired(estimate.size());
  for (const auto& pair : poses.indices) paired[pair.second] = true;
  const double near = options.max_time_difference_s;
  std::size_t count = 0;
  for (std::size_t k = 0; k < estimate.size(); ++k) {
    const double stamp = estimate[k].stamp_s + options.time_offset_s;
    const bool within = stamp >= reference.front().stamp_s - near && stamp <= reference.back().stamp_s + near;
    if (within && !paired[k]) ++count;
  }
  return count;
}

/// What can't be done with positions alone.
void RequireRotations(const Trajectory& reference, const Trajectory& estimate,
                      const EvaluationOptions& options) {
  const bool of_reference = HasRotations(reference), of_estimate = HasRotations(estimate);
  const std::string which = of_reference ? "the estimate" : "the reference";
  if (options.alignment == TrajectoryAlignment::kOrigin && !(of_reference && of_estimate))
    throw InputError("evaluation: " + which +
                     " has positions alone, and the alignment origin needs rotations; align by se3 or sim3");
  const bool by_angle = options.rpe_unit == DeltaUnit::kDegrees || options.rpe_unit == DeltaUnit::kRadians;
  if (by_angle && !of_estimate)
    throw InputError(
        "evaluation: the estimate has positions alone; rpe_unit must be frames, metres or seconds");
  const bool filtered = options.motion_filter && options.motion_filter->distance_m == 0;
  if (filtered && !(of_reference && of_estimate))
    throw InputError("evaluation: " + which +
                     " has positions alone, which do not turn; give motion_filter a distance");
}

Similarity Align(const EvaluationReport& report, const EvaluationOptions& options) {
  try {
    return AlignPoses(report.poses, options);
  } catch (const InputError& error) {
    if (options.interpolate || report.coverage.unpaired <= report.pairs) throw;
    char limit[32];
    std::snprintf(limit, sizeof limit, "%g", options.max_time_difference_s);
    throw InputError(std::string(error.what()) + "; " + std::to_string(report.coverage.unpaired) +
                     " poses have no partner within " + limit +
                     " s (--max-diff, max_time_difference_s in code; or --interpolate)");
  }
}

void MeasureRotations(const std::vector<PoseMatrix>& a, const std::vector<PoseMatrix>& b, bool kitti,
                      EvaluationReport& out) {
  out.ate_rotation = Summarize(out.absolute.rotation_deg);
  out.ate_full = Summarize(out.absolute.full);
  out.relative = RelativeErrors(a, b, out.relative_pairs);
  out.rpe = Summarize(out.relative.translation);
  out.rpe_rotation = Summarize(out.relative.rotation_deg);
  out.rpe_full = Summarize(out.relative.full);
  if (!kitti) return;
  out.kitti = EvaluateKitti(a, b);
  out.drift = EvaluateDrift(a, b);
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
  if (rpe_unit == DeltaUnit::kRadians && rpe_delta > M_PI && rpe_all_pairs)
    return "evaluation: no two poses are more than pi apart; rpe_delta is too large";
  if (motion_filter && !(motion_filter->distance_m >= 0 && motion_filter->angle_deg >= 0))
    return "evaluation: the limits of motion_filter must not be negative";
  if (motion_filter && by_index)
    return "evaluation: poses that are paired line by line can't be filtered by their motion; give time "
           "stamps (KITTI: times.txt)";
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

std::vector<double> PointDistanceErrors(const std::vector<PoseMatrix>& reference,
                                        const std::vector<PoseMatrix>& estimate,
                                        const std::vector<std::pair<std::size_t, std::size_t>>& pairs) {
  std::vector<double> out;
  out.reserve(pairs.size());
  for (const auto& [i, j] : pairs) {
    out.push_back(std::abs((reference[i].translation - reference[j].translation).norm() -
                           (estimate[i].translation - estimate[j].translation).norm()));
  }
  return out;
}

std::vector<double> PointDistanceRatios(const std::vector<PoseMatrix>& reference,
                                        const std::vector<PoseMatrix>& estimate,
                                        const std::vector<std::pair<std::size_t, std::size_t>>& pairs) {
  const std::vector<double> errors = PointDistanceErrors(reference, estimate, pairs);
  std::vector<double> out;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    const auto& [i, j] = pairs[k];
    const double distance = (reference[i].translation - reference[j].translation).norm();
    if (distance > 0) out.push_back(100 * errors[k] / distance);
  }
  return out;
}

EvaluationReport EvaluateTrajectory(const Trajectory& reference, const Trajectory& estimate,
                                    const EvaluationOptions& options, const RotationsAsWritten& written) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
  RequireOnePerPose(written.reference, reference);
  RequireOnePerPose(written.estimate, estimate);
  RequireRotations(reference, estimate, options);
  const Kept r = Keep(reference, written.reference, options), e = Keep(estimate, written.estimate, options);
  EvaluationReport out;
  out.poses = Associate(r.trajectory, e.trajectory, options);
  out.pairs = out.poses.indices.size();
  out.reference_poses = r.trajectory.size();
  out.estimate_poses = e.trajectory.size();
  out.association = StatisticsOf(out.poses, r.trajectory, e.trajectory, options);
  out.coverage = CoverageOf(reference, estimate, options.time_offset_s, options.max_time_difference_s,
                            options.frame_stamps_s);
  if (!options.by_index) out.coverage.unpaired = Unpaired(out.poses, r.trajectory, e.trajectory, options);
  out.rotations = HasRotations(reference) && HasRotations(estimate);
  out.alignment = options.alignment;
  out.S_reference_estimate = Align(out, options);
  if (options.alignment != TrajectoryAlignment::kNone) {
    for (Pose& pose : out.poses.estimate) pose = ApplyAlignment(out.S_reference_estimate, pose);
  }
  std::vector<PoseMatrix> a =
      Matrices(out.poses, true, options.interpolate ? std::vector<Eigen::Matrix3d>() : r.written,
               Eigen::Quaterniond::Identity());
  std::vector<PoseMatrix> b = Matrices(out.poses, false, e.written, out.S_reference_estimate.rotation);
  if (options.plane != ProjectionPlane::kNone) {
    Project(options.plane, out.poses.reference, a);
    Project(options.plane, out.poses.estimate, b);
  }
  for (std::size_t k = 1; k < a.size(); ++k)
    out.path_length_m += (a[k].translation - a[k - 1].translation).norm();
  out.absolute = AbsoluteErrors(a, b);
  out.ate = Summarize(out.absolute.translation);
  if (!out.rotations) out.absolute.rotation_deg = out.absolute.full = {};
  out.relative_pairs = RelativePairs(out.poses.estimate, out.poses.stamps_s, options);
  out.point_distance_errors = PointDistanceErrors(a, b, out.relative_pairs);
  out.rpe_point_distance = Summarize(out.point_distance_errors);
  out.rpe_point_distance_ratio = Summarize(PointDistanceRatios(a, b, out.relative_pairs));
  if (out.rotations) MeasureRotations(a, b, options.kitti, out);
  return out;
}

}  // namespace tutti
