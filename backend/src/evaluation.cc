#include "tutti/backend/evaluation.h"

#include <algorithm>
#include <cmath>

#include "tutti/core/error.h"

namespace tutti {
namespace {

constexpr double kDegrees = 180.0 / M_PI;

/// Distance along the path from the first pose to each.
std::vector<double> AccumulatedDistances(const std::vector<Pose>& poses) {
  std::vector<double> out;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    out.push_back(k == 0 ? 0.0 : out.back() + (poses[k].translation - poses[k - 1].translation).norm());
  }
  return out;
}

/// Error of the relative pose from i to j: (T_i^-1 T_j of the reference)^-1 (that of the estimate).
Pose RelativeError(const std::vector<Pose>& reference, const std::vector<Pose>& estimate, std::size_t i,
                   std::size_t j) {
  return (reference[i].Inverse() * reference[j]).Inverse() * (estimate[i].Inverse() * estimate[j]);
}

std::vector<std::pair<std::size_t, std::size_t>> PairsByFrames(std::size_t n, std::size_t delta,
                                                               bool all_pairs) {
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (std::size_t i = 0; i + delta < n; i += all_pairs ? 1 : delta) out.emplace_back(i, i + delta);
  return out;
}

std::vector<std::pair<std::size_t, std::size_t>> AllPairsByPath(const std::vector<double>& distance,
                                                                double delta, double tolerance) {
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (std::size_t i = 0; i + 1 < distance.size(); ++i) {
    std::size_t best = i + 1;
    for (std::size_t j = i + 1; j < distance.size(); ++j) {
      if (std::abs(distance[j] - distance[i] - delta) < std::abs(distance[best] - distance[i] - delta))
        best = j;
      if (distance[j] - distance[i] > 2 * delta) break;  // distances only grow
    }
    if (std::abs(distance[best] - distance[i] - delta) <= tolerance) out.emplace_back(i, best);
  }
  return out;
}

/// Consecutive pieces: a cut wherever the path since the last cut has reached delta; the piece before the
/// first cut is not used (as in evo).
std::vector<std::pair<std::size_t, std::size_t>> ConsecutiveByPath(const std::vector<Pose>& poses,
                                                                   double delta) {
  std::vector<std::size_t> cuts;
  double path = 0;
  for (std::size_t k = 1; k < poses.size(); ++k) {
    path += (poses[k].translation - poses[k - 1].translation).norm();
    if (path >= delta) {
      cuts.push_back(k);
      path = 0;
    }
  }
  std::vector<std::pair<std::size_t, std::size_t>> out;
  for (std::size_t k = 1; k < cuts.size(); ++k) out.emplace_back(cuts[k - 1], cuts[k]);
  return out;
}

}  // namespace

std::string EvaluationOptions::Validate() const {
  if (!(max_time_difference_s >= 0)) return "evaluation: max_time_difference_s must not be negative";
  if (!(rpe_delta > 0) || !std::isfinite(rpe_delta)) return "evaluation: rpe_delta must be positive";
  if (rpe_unit == DeltaUnit::kFrames && rpe_delta != std::floor(rpe_delta)) {
    return "evaluation: rpe_delta must be a whole number of frames";
  }
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

std::vector<double> AbsoluteTranslationErrors(const AssociatedPoses& poses) {
  std::vector<double> out;
  for (std::size_t k = 0; k < poses.reference.size(); ++k) {
    out.push_back((poses.reference[k].translation - poses.estimate[k].translation).norm());
  }
  return out;
}

std::vector<double> AbsoluteRotationErrors(const AssociatedPoses& poses) {
  std::vector<double> out;
  for (std::size_t k = 0; k < poses.reference.size(); ++k) {
    out.push_back(kDegrees *
                  LogSO3(poses.reference[k].rotation.conjugate() * poses.estimate[k].rotation).norm());
  }
  return out;
}

std::vector<std::pair<std::size_t, std::size_t>> RelativePairs(const std::vector<Pose>& estimate,
                                                               const EvaluationOptions& options) {
  if (options.rpe_unit == DeltaUnit::kFrames) {
    return PairsByFrames(estimate.size(), static_cast<std::size_t>(options.rpe_delta), options.rpe_all_pairs);
  }
  if (!options.rpe_all_pairs) return ConsecutiveByPath(estimate, options.rpe_delta);
  return AllPairsByPath(AccumulatedDistances(estimate), options.rpe_delta,
                        options.rpe_tolerance * options.rpe_delta);
}

KittiErrors EvaluateKitti(const std::vector<Pose>& reference, const std::vector<Pose>& estimate) {
  constexpr std::size_t kStep = 10;
  const std::vector<double> distance = AccumulatedDistances(reference);
  KittiErrors out;
  double translation = 0, rotation = 0;
  for (std::size_t first = 0; first < reference.size(); first += kStep) {
    for (double length = 100; length <= 800; length += 100) {
      const auto last = std::upper_bound(distance.begin(), distance.end(), distance[first] + length);
      if (last == distance.end()) break;
      const Pose error =
          RelativeError(reference, estimate, first, static_cast<std::size_t>(last - distance.begin()));
      translation += error.translation.norm() / length;
      rotation += error.Angle() / length;
      ++out.segments;
    }
  }
  if (out.segments == 0) return out;
  out.translation_percent = 100.0 * translation / static_cast<double>(out.segments);
  out.rotation_deg_per_m = kDegrees * rotation / static_cast<double>(out.segments);
  return out;
}

EvaluationReport EvaluateTrajectory(const Trajectory& reference, const Trajectory& estimate,
                                    const EvaluationOptions& options) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
  AssociatedPoses poses = options.by_index
                              ? AssociateByIndex(reference, estimate)
                              : AssociateByTime(reference, estimate, options.max_time_difference_s);
  EvaluationReport out;
  out.pairs = poses.indices.size();
  out.reference_poses = reference.size();
  out.estimate_poses = estimate.size();
  out.alignment = options.alignment;
  out.S_reference_estimate = AlignPoses(poses, options.alignment);
  if (options.alignment != TrajectoryAlignment::kNone) {
    for (Pose& pose : poses.estimate) pose = ApplyAlignment(out.S_reference_estimate, pose);
  }
  out.path_length_m = AccumulatedDistances(poses.reference).back();
  out.ate = Summarize(AbsoluteTranslationErrors(poses));
  out.ate_rotation = Summarize(AbsoluteRotationErrors(poses));
  std::vector<double> translation, rotation;
  for (const auto& [i, j] : RelativePairs(poses.estimate, options)) {
    const Pose error = RelativeError(poses.reference, poses.estimate, i, j);
    translation.push_back(error.translation.norm());
    rotation.push_back(kDegrees * error.Angle());
  }
  out.rpe = Summarize(std::move(translation));
  out.rpe_rotation = Summarize(std::move(rotation));
  if (options.kitti) out.kitti = EvaluateKitti(poses.reference, poses.estimate);
  return out;
}

}  // namespace tutti
