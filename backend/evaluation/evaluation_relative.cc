// Which poses are compared with each other, and over which segments.
#include <algorithm>
#include <cmath>

#include "core/numbers.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using Pairs = std::vector<std::pair<std::size_t, std::size_t>>;

constexpr double kStampEpsilon = 1e-9;  // a second is a second, whatever the last bit says [s]

/// Distance along the path from the first pose to each [m]. `T` has a member `translation`.
template <typename T>
std::vector<double> PathLengths(const std::vector<T>& poses) {
  std::vector<double> out;
  out.reserve(poses.size());
  for (std::size_t k = 0; k < poses.size(); ++k) {
    out.push_back(k == 0 ? 0.0 : out.back() + (poses[k].translation - poses[k - 1].translation).norm());
  }
  return out;
}

Pairs PairsByFrames(std::size_t n, std::size_t delta, bool all_pairs) {
  Pairs out;
  for (std::size_t i = 0; i + delta < n; i += all_pairs ? 1 : delta) out.emplace_back(i, i + delta);
  return out;
}

/// For every start, the end whose growing `measure` is nearest to delta, if it is near enough.
Pairs NearestPairs(const std::vector<double>& measure, double delta, double tolerance) {
  Pairs out;
  for (std::size_t i = 0; i + 1 < measure.size(); ++i) {
    std::size_t best = i + 1;
    for (std::size_t j = i + 1; j < measure.size(); ++j) {
      if (std::abs(measure[j] - measure[i] - delta) < std::abs(measure[best] - measure[i] - delta)) best = j;
      if (measure[j] - measure[i] > 2 * delta) break;  // it only grows
    }
    if (std::abs(measure[best] - measure[i] - delta) <= tolerance) out.emplace_back(i, best);
  }
  return out;
}

/// Cuts wherever the sum of `steps` since the last cut has reached delta. steps[k] leads to pose k.
std::vector<std::size_t> Cuts(const std::vector<double>& steps, double delta) {
  std::vector<std::size_t> cuts;
  double sum = 0;
  for (std::size_t k = 1; k < steps.size(); ++k) {
    sum += steps[k];
    if (sum < delta) continue;
    cuts.push_back(k);
    sum = 0;
  }
  return cuts;
}

Pairs Pieces(const std::vector<std::size_t>& cuts) {
  Pairs out;
  for (std::size_t k = 1; k < cuts.size(); ++k) out.emplace_back(cuts[k - 1], cuts[k]);
  return out;
}

double AngleDeg(const Pose& a, const Pose& b) {
  return internal::kDegrees * LogSO3(a.rotation.conjugate() * b.rotation).norm();
}

Pairs PairsByAngle(const std::vector<Pose>& poses, double delta, double tolerance, bool all_pairs) {
  Pairs out;
  if (all_pairs) {
    for (std::size_t i = 0; i < poses.size(); ++i) {
      for (std::size_t j = i + 1; j < poses.size(); ++j) {
        if (std::abs(AngleDeg(poses[i], poses[j]) - delta) <= tolerance) out.emplace_back(i, j);
      }
    }
    return out;
  }
  std::vector<double> steps(poses.size(), 0.0);
  for (std::size_t k = 1; k < poses.size(); ++k) steps[k] = AngleDeg(poses[k - 1], poses[k]);
  std::vector<std::size_t> cuts = Cuts(steps, delta);
  cuts.insert(cuts.begin(), 0);
  return Pieces(cuts);
}

Pairs PairsByTime(const std::vector<double>& stamps, double delta, double tolerance, bool all_pairs) {
  if (all_pairs) return NearestPairs(stamps, delta, tolerance + kStampEpsilon);
  std::vector<std::size_t> cuts;
  for (std::size_t k = 0; k < stamps.size(); ++k) {
    if (cuts.empty() || stamps[k] - stamps[cuts.back()] >= delta - kStampEpsilon) cuts.push_back(k);
  }
  return Pieces(cuts);
}

std::vector<double> Steps(const std::vector<Pose>& poses) {
  std::vector<double> steps(poses.size(), 0.0);
  for (std::size_t k = 1; k < poses.size(); ++k)
    steps[k] = (poses[k].translation - poses[k - 1].translation).norm();
  return steps;
}

PoseMatrix MatrixOf(const Pose& pose) { return {pose.rotation.toRotationMatrix(), pose.translation}; }

/// a^-1 b with the inverse of a matrix that need not be a rotation.
PoseMatrix BetweenMatrices(const PoseMatrix& a, const PoseMatrix& b) {
  const Eigen::Matrix3d inverse = a.rotation.inverse();
  return {inverse * b.rotation, inverse * (b.translation - a.translation)};
}

}  // namespace

Pairs RelativePairs(const std::vector<Pose>& estimate, const std::vector<double>& stamps_s,
                    const EvaluationOptions& options) {
  const double delta = options.rpe_delta, tolerance = options.rpe_tolerance * delta;
  switch (options.rpe_unit) {
    case DeltaUnit::kFrames:
      return PairsByFrames(estimate.size(), static_cast<std::size_t>(delta), options.rpe_all_pairs);
    case DeltaUnit::kMetres:
      // The piece before the first cut is not used, as in evo.
      return options.rpe_all_pairs ? NearestPairs(PathLengths(estimate), delta, tolerance)
                                   : Pieces(Cuts(Steps(estimate), delta));
    case DeltaUnit::kDegrees:
      return PairsByAngle(estimate, delta, tolerance, options.rpe_all_pairs);
    case DeltaUnit::kRadians:
      return PairsByAngle(estimate, internal::kDegrees * delta, internal::kDegrees * tolerance,
                          options.rpe_all_pairs);
    case DeltaUnit::kSeconds:
      return PairsByTime(stamps_s, delta, tolerance, options.rpe_all_pairs);
  }
  return {};
}

SegmentErrors EvaluateSegments(const std::vector<PoseMatrix>& reference,
                               const std::vector<PoseMatrix>& estimate, const std::vector<double>& lengths_m,
                               std::size_t step) {
  const std::vector<double> distance = PathLengths(reference);
  SegmentErrors out;
  double translation = 0, rotation = 0;
  for (std::size_t first = 0; first < reference.size(); first += step) {
    for (const double length : lengths_m) {
      const auto end = std::upper_bound(distance.begin(), distance.end(), distance[first] + length);
      if (end == distance.end()) break;
      const auto last = static_cast<std::size_t>(end - distance.begin());
      const PoseMatrix error = BetweenMatrices(BetweenMatrices(estimate[first], estimate[last]),
                                               BetweenMatrices(reference[first], reference[last]));
      const double cosine = 0.5 * (error.rotation.trace() - 1.0);
      translation += error.translation.norm() / length;
      rotation += std::acos(std::clamp(cosine, -1.0, 1.0)) / length;
      ++out.segments;
    }
  }
  if (out.segments == 0) return out;
  out.translation_percent = 100.0 * translation / static_cast<double>(out.segments);
  out.rotation_deg_per_m = internal::kDegrees * rotation / static_cast<double>(out.segments);
  return out;
}

KittiErrors EvaluateKitti(const std::vector<PoseMatrix>& reference, const std::vector<PoseMatrix>& estimate) {
  return EvaluateSegments(reference, estimate, {100, 200, 300, 400, 500, 600, 700, 800}, 10);
}

KittiErrors EvaluateKitti(const std::vector<Pose>& reference, const std::vector<Pose>& estimate) {
  std::vector<PoseMatrix> a, b;
  for (const Pose& pose : reference) a.push_back(MatrixOf(pose));
  for (const Pose& pose : estimate) b.push_back(MatrixOf(pose));
  return EvaluateKitti(a, b);
}

SegmentErrors EvaluateDrift(const std::vector<PoseMatrix>& reference,
                            const std::vector<PoseMatrix>& estimate) {
  const std::vector<double> distance = PathLengths(reference);
  if (distance.empty() || !(distance.back() > 0)) return {};
  std::vector<double> lengths;
  for (const double share : {0.1, 0.2, 0.3, 0.4, 0.5}) lengths.push_back(share * distance.back());
  return EvaluateSegments(reference, estimate, lengths, 1);
}

}  // namespace tutti
