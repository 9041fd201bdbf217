// Which poses are compared, and how much of the reference they are.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <limits>

#include "core/numbers.h"
#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

std::string Range(const Trajectory& trajectory) {
  char text[96];
  std::snprintf(text, sizeof text, "%.3f .. %.3f s", trajectory.front().stamp_s, trajectory.back().stamp_s);
  return text;
}

std::string Short(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string Ranges(const Trajectory& reference, const Trajectory& estimate, double offset_s) {
  std::string text = "the reference spans " + Range(reference) + ", the estimate " + Range(estimate);
  if (offset_s != 0) text += " (before the offset of " + Short(offset_s) + " s)";
  return text + "; check that the files belong together and use the same clock";
}

/// For trajectories that nearly fit in time.
std::string Remedy(double nearest_s) {
  constexpr double kNear = 1.0;  // [s]
  if (nearest_s > kNear) return {};
  return " (pair them with --max-diff " + Short(std::ceil(1e3 * nearest_s + 1e-3) / 1e3) +
         ", max_time_difference_s in code, or with --interpolate)";
}

/// Position of the nearest time stamp; the first of two that are equally near.
std::size_t Nearest(const Trajectory& sorted, double stamp_s) {
  std::size_t low = 0, high = sorted.size();
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    sorted[middle].stamp_s < stamp_s ? low = middle + 1 : high = middle;
  }
  if (low == sorted.size()) return low - 1;
  if (low > 0 && stamp_s - sorted[low - 1].stamp_s <= sorted[low].stamp_s - stamp_s) return low - 1;
  return low;
}

void RequirePoses(const Trajectory& reference, const Trajectory& estimate) {
  if (reference.empty()) throw InputError("evaluation: the reference holds no pose");
  if (estimate.empty()) throw InputError("evaluation: the estimate holds no pose");
}

void AddPair(AssociatedPoses& out, const Trajectory& reference, const Trajectory& estimate, std::size_t r,
             std::size_t e) {
  out.indices.emplace_back(r, e);
  out.stamps_s.push_back(estimate[e].stamp_s);
  out.reference.push_back(reference[r].pose);
  out.estimate.push_back(estimate[e].pose);
}

/// Stamps are not quite even: a gap this much short of a whole number of intervals is one.
constexpr double kUneven = 0.1;  // [intervals]

std::vector<double> Stamps(const Trajectory& trajectory, double offset_s) {
  std::vector<double> out;
  for (const StampedPose& pose : trajectory) out.push_back(pose.stamp_s + offset_s);
  return out;
}

double MedianInterval(const std::vector<double>& stamps) {
  std::vector<double> intervals;
  for (std::size_t k = 1; k < stamps.size(); ++k) intervals.push_back(stamps[k] - stamps[k - 1]);
  return intervals.empty() ? 0 : internal::Median(std::move(intervals));
}

std::vector<double> Within(const std::vector<double>& stamps, double first, double last) {
  std::vector<double> out;
  std::copy_if(stamps.begin(), stamps.end(), std::back_inserter(out),
               [&](double stamp) { return stamp >= first && stamp <= last; });
  return out;
}

std::size_t Whole(double intervals) {
  return intervals > 0 ? static_cast<std::size_t>(std::floor(intervals + kUneven)) : 0;
}

TrajectoryCoverage CoverageOfFrames(const std::vector<double>& frames, const std::vector<double>& poses,
                                    double tolerance_s) {
  const double near = std::min(tolerance_s, 0.5 * MedianInterval(frames));
  TrajectoryCoverage out;
  out.all = frames.size();
  for (const double frame : frames) {
    const auto after = std::lower_bound(poses.begin(), poses.end(), frame - near);
    if (after != poses.end() && *after <= frame + near) ++out.posed;
  }
  return out;
}

}  // namespace

AssociatedPoses AssociateByTime(const Trajectory& reference, const Trajectory& estimate,
                                double max_difference_s, double offset_s) {
  RequirePoses(reference, estimate);
  const bool estimate_is_longer = estimate.size() > reference.size();
  // Loop over the shorter (the estimate, if they are equally long: evo loops over its second trajectory
  // then).
  const Trajectory& shorter = estimate_is_longer ? reference : estimate;
  const Trajectory& longer = estimate_is_longer ? estimate : reference;
  const double offset_of_shorter = estimate_is_longer ? -offset_s : offset_s;
  AssociatedPoses out;
  double nearest_s = std::numeric_limits<double>::infinity();
  for (std::size_t s = 0; s < shorter.size(); ++s) {
    const double stamp = shorter[s].stamp_s + offset_of_shorter;
    const std::size_t l = Nearest(longer, stamp);
    const double apart_s = std::abs(longer[l].stamp_s - stamp);
    nearest_s = std::min(nearest_s, apart_s);
    if (apart_s > max_difference_s) continue;
    estimate_is_longer ? AddPair(out, reference, estimate, s, l) : AddPair(out, reference, estimate, l, s);
  }
  if (out.indices.empty()) {
    throw InputError("evaluation: no two poses are within " + Short(max_difference_s) +
                     " s of each other; the nearest are " + Short(nearest_s) + " s apart" +
                     Remedy(nearest_s) + ": " + Ranges(reference, estimate, offset_s));
  }
  return out;
}

AssociatedPoses AssociateByInterpolation(const Trajectory& reference, const Trajectory& estimate,
                                         double max_gap_s, double offset_s) {
  RequirePoses(reference, estimate);
  AssociatedPoses out;
  for (std::size_t e = 0; e < estimate.size(); ++e) {
    const double stamp = estimate[e].stamp_s + offset_s;
    const std::optional<Pose> pose = InterpolatePose(reference, stamp, max_gap_s);
    if (!pose) continue;
    std::size_t before = Nearest(reference, stamp);
    if (before > 0 && reference[before].stamp_s > stamp) --before;
    AddPair(out, reference, estimate, before, e);
    out.reference.back() = *pose;
  }
  if (out.indices.empty()) {
    throw InputError(
        "evaluation: no pose of the estimate lies between two of the reference that are at most " +
        Short(max_gap_s) + " s apart: " + Ranges(reference, estimate, offset_s));
  }
  return out;
}

std::optional<Pose> InterpolatePose(const Trajectory& trajectory, double stamp_s, double max_gap_s) {
  constexpr double kSame = 1e-6;  // [s]
  const auto after = std::lower_bound(trajectory.begin(), trajectory.end(), stamp_s,
                                      [](const StampedPose& a, double stamp) { return a.stamp_s < stamp; });
  if (after != trajectory.end() && std::abs(after->stamp_s - stamp_s) < kSame) return after->pose;
  if (after != trajectory.begin() && std::abs(std::prev(after)->stamp_s - stamp_s) < kSame)
    return std::prev(after)->pose;
  if (after == trajectory.begin() || after == trajectory.end()) return std::nullopt;
  const StampedPose &a = *std::prev(after), &b = *after;
  const double gap = b.stamp_s - a.stamp_s;
  if (gap > max_gap_s) return std::nullopt;
  const double share = (stamp_s - a.stamp_s) / gap;
  return Pose(a.pose.rotation.slerp(share, b.pose.rotation),
              (1 - share) * a.pose.translation + share * b.pose.translation);
}

std::optional<Pose> PoseOfFrame(const Trajectory& reference, double stamp_s, double frame_interval_s) {
  constexpr double kMaxGap = 0.2;  // [s]
  if (reference.empty()) return std::nullopt;
  if (std::optional<Pose> between = InterpolatePose(reference, stamp_s, kMaxGap)) return between;
  const StampedPose& nearest = reference[Nearest(reference, stamp_s)];
  if (!(std::abs(nearest.stamp_s - stamp_s) <= 0.5 * frame_interval_s)) return std::nullopt;
  return nearest.pose;
}

AssociatedPoses AssociateByIndex(const Trajectory& reference, const Trajectory& estimate) {
  RequirePoses(reference, estimate);
  if (reference.size() != estimate.size()) {
    throw InputError("evaluation: the reference has " + std::to_string(reference.size()) +
                     " poses and the estimate " + std::to_string(estimate.size()) +
                     "; poses without time stamps are paired line by line and the counts must agree");
  }
  AssociatedPoses out;
  for (std::size_t k = 0; k < reference.size(); ++k) AddPair(out, reference, estimate, k, k);
  return out;
}

std::vector<std::size_t> EvenlySpacedPoses(std::size_t poses, std::size_t count) {
  std::vector<std::size_t> out;
  const bool all = poses <= count;
  const double step =
      all || count < 2 ? 1.0 : static_cast<double>(poses - 1) / static_cast<double>(count - 1);
  for (std::size_t k = 0; k < std::min(poses, count); ++k)
    out.push_back(static_cast<std::size_t>(std::floor(static_cast<double>(k) * step)));
  if (count > 1 && !all) out.back() = poses - 1;
  return out;
}

std::vector<std::size_t> MovedPoses(const Trajectory& trajectory, const MotionFilter& filter) {
  std::vector<std::size_t> out;
  double path = 0, path_of_last = 0;
  for (std::size_t k = 0; k < trajectory.size(); ++k) {
    const Pose& pose = trajectory[k].pose;
    if (k > 0) path += (pose.translation - trajectory[k - 1].pose.translation).norm();
    const bool counts =
        out.empty() || path - path_of_last >= filter.distance_m ||
        internal::kDegrees *
                LogSO3(trajectory[out.back()].pose.rotation.conjugate() * pose.rotation).norm() >=
            filter.angle_deg;
    if (!counts) continue;
    out.push_back(k);
    path_of_last = path;
  }
  return out;
}

TrajectoryCoverage CoverageOf(const Trajectory& reference, const Trajectory& estimate, double offset_s,
                              double tolerance_s, const std::vector<double>& frame_stamps_s) {
  TrajectoryCoverage out;
  if (reference.empty() || estimate.empty()) return out;
  const double begin = reference.front().stamp_s, end = reference.back().stamp_s;
  const std::vector<double> all = Stamps(estimate, offset_s);
  if (!frame_stamps_s.empty()) {
    std::vector<double> frames = frame_stamps_s;
    for (double& stamp : frames) stamp += offset_s;
    return CoverageOfFrames(Within(frames, begin - tolerance_s, end + tolerance_s), all, tolerance_s);
  }
  const std::vector<double> poses = Within(all, begin - tolerance_s, end + tolerance_s);
  double interval = MedianInterval(all);
  if (!(interval > 0)) interval = MedianInterval(Stamps(reference, 0));
  out.posed = out.all = poses.size();
  if (!(interval > 0)) return out;
  if (poses.empty()) {
    out.all = Whole((end - begin) / interval) + 1;
    return out;
  }
  out.all += Whole((poses.front() - begin) / interval) + Whole((end - poses.back()) / interval);
  for (std::size_t k = 1; k < poses.size(); ++k) {
    const auto steps = static_cast<std::size_t>(std::llround((poses[k] - poses[k - 1]) / interval));
    if (steps > 1) out.all += steps - 1;
  }
  return out;
}

}  // namespace tutti
