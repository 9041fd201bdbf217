// How much of the reference an estimate has poses for.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "core/median.h"
#include "tutti/backend/evaluation.h"

namespace tutti {
namespace {

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
