#include "apps/slam/trajectory_correction.h"

#include <algorithm>
#include <string>
#include <utility>

#include "tutti/core/error.h"

namespace tutti {
namespace {

// How much longer the way between two keyframes has become; 1 where they are at one place.
double Stretch(const Trajectory& before, const Trajectory& after, std::size_t a, std::size_t b) {
  const double was = (before[b].pose.translation - before[a].pose.translation).norm();
  const double is = (after[b].pose.translation - after[a].pose.translation).norm();
  return was > 1e-9 ? is / was : 1;
}

Pose Move(const Pose& pose, const Pose& before, const Pose& after, double scale) {
  Pose step = before.Inverse() * pose;
  step.translation *= scale;
  return after * step;
}

// One between these times; null: there is none.
const OdometryJump* LastingJump(double begin_s, double end_s, const std::vector<OdometryJump>& jumps) {
  const auto found = std::find_if(jumps.begin(), jumps.end(), [&](const OdometryJump& jump) {
    return !jump.comes_back && begin_s < jump.to_s && jump.to_s <= end_s;
  });
  return found == jumps.end() ? nullptr : &*found;
}

}  // namespace

Trajectory CorrectTrajectory(Trajectory odometry, Trajectory before, Trajectory after,
                             const std::vector<OdometryJump>& jumps) {
  if (before.size() != after.size())
    throw InputError(std::to_string(before.size()) + " keyframes of the odometry and " +
                     std::to_string(after.size()) + " corrected ones; they must be as many");
  odometry = WithoutOutliers(std::move(odometry), jumps);
  before = OnlyInliers(before, jumps);
  after = OnlyInliers(after, jumps);
  if (before.empty()) return odometry;
  const std::size_t last = before.size() - 1;
  Trajectory out;
  out.reserve(odometry.size());
  std::size_t next = 0;  // the first keyframe that is later
  for (const StampedPose& p : odometry) {
    while (next <= last && before[next].stamp_s <= p.stamp_s) ++next;
    if (next == 0 || next > last) {
      const std::size_t end = next == 0 ? 0 : last;
      const double scale =
          last == 0 ? 1 : Stretch(before, after, next == 0 ? 0 : last - 1, next == 0 ? 1 : last);
      out.push_back({p.stamp_s, Move(p.pose, before[end].pose, after[end].pose, scale)});
      continue;
    }
    const std::size_t a = next - 1;
    double share = (p.stamp_s - before[a].stamp_s) / (before[next].stamp_s - before[a].stamp_s);
    if (const OdometryJump* jump = LastingJump(before[a].stamp_s, before[next].stamp_s, jumps))
      share = p.stamp_s >= jump->to_s ? 1 : 0;
    const Pose by_a = Move(p.pose, before[a].pose, after[a].pose, 1),
               by_b = Move(p.pose, before[next].pose, after[next].pose, 1);
    out.push_back({p.stamp_s,
                   {by_a.rotation.slerp(share, by_b.rotation),
                    (1 - share) * by_a.translation + share * by_b.translation}});
  }
  return out;
}

}  // namespace tutti
