#include "apps/slam/odometry_jumps.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "core/numbers.h"

namespace tutti {
namespace {

using Vectors = std::vector<Eigen::Vector3d>;

constexpr std::size_t kAround = 7;    // steps on either side of one
constexpr std::size_t kUsual = 128;   // the same, for what is usual
constexpr std::size_t kBlock = 64;    // steps that share it
constexpr std::size_t kOutliers = 5;  // most poses in a row
constexpr std::size_t kFewest = 10;   // steps that tell what is usual
constexpr double kTimesUsual = 8;  // real trajectories reach 5 (KITTI, EuRoC, TUM, every 1st to 20th pose),
constexpr double kTimesSpeed = 2;  // or are no faster than the 4th fastest step around
constexpr double kBackTimesSpeed = 0.3;  // the same for a step that is taken back
constexpr double kBack = 0.3;            // of a jump that is left when it is taken back

// What a jump is at least, whatever is usual.
struct Least {
  double step, speed;    // [m, m/s] or [rad, rad/s]
  double times_usual;    // or such a multiple of the usual speed
  double usual_seconds;  // and the way that takes so long
};
constexpr Least kTranslation = {0.05, 1, 20, 0.05};
constexpr Least kRotation = {2 * internal::kRadians, 1, std::numeric_limits<double>::infinity(), 0};

// Velocities from pose to pose, in the frame of the pose before, and how far they are from those around.
class Velocities {
 public:
  Velocities(Vectors velocities, const std::vector<double>& times, const Least& least)
      : velocities_(std::move(velocities)), times_(times), least_(least) {
    for (std::size_t i = 0; i < velocities_.size(); ++i) {
      speeds_.push_back(velocities_[i].norm());
      around_.push_back(MedianAround(i));
      differences_.push_back((velocities_[i] - around_[i]).norm());
    }
    for (std::size_t begin = 0; begin < velocities_.size(); begin += kBlock) {
      usual_difference_.push_back(NinetiethOfHundred(differences_, begin));
      usual_speed_.push_back(NinetiethOfHundred(speeds_, begin));
    }
  }

  double Jump(std::size_t i) const { return differences_[i] * times_[i]; }
  bool Jumps(std::size_t i, double times_speed) const {
    const double difference = differences_[i], usual_speed = usual_speed_[i / kBlock];
    if (Jump(i) < std::max(least_.step, least_.usual_seconds * usual_speed)) return false;
    if (difference < least_.speed && !(usual_speed > 0 && difference > least_.times_usual * usual_speed))
      return false;
    return difference > kTimesUsual * usual_difference_[i / kBlock] &&
           difference > times_speed * FourthFastestAround(i);
  }
  // Whether so much in so long a time is what is usual around step i, or what two jumps leave.
  bool Fits(const Eigen::Vector3d& motion, double time, std::size_t i, std::size_t j) const {
    const double usual = std::max(least_.step, kTimesUsual * usual_difference_[i / kBlock] * time);
    return (motion - time * around_[i]).norm() <= std::max(usual, kBack * std::min(Jump(i), Jump(j)));
  }

 private:
  std::size_t Begin(std::size_t i) const { return i < kAround ? 0 : i - kAround; }
  std::size_t End(std::size_t i) const { return std::min(velocities_.size(), i + kAround + 1); }

  Eigen::Vector3d MedianAround(std::size_t i) const {
    Eigen::Vector3d median;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> values;
      for (std::size_t j = Begin(i); j < End(i); ++j) values.push_back(velocities_[j][axis]);
      median[axis] = internal::Median(std::move(values));
    }
    return median;
  }
  // Jumps come in twos, and two of those that is: what moves goes on for longer.
  double FourthFastestAround(std::size_t i) const {
    std::vector<double> values(speeds_.begin() + static_cast<std::ptrdiff_t>(Begin(i)),
                               speeds_.begin() + static_cast<std::ptrdiff_t>(End(i)));
    std::nth_element(values.begin(), values.begin() + 3, values.end(), std::greater_equal<>());
    return values[3];
  }
  static double NinetiethOfHundred(const std::vector<double>& all, std::size_t block) {
    const std::size_t begin = block < kUsual ? 0 : block - kUsual;
    std::vector<double> values(
        all.begin() + static_cast<std::ptrdiff_t>(begin),
        all.begin() + static_cast<std::ptrdiff_t>(std::min(all.size(), block + kBlock + kUsual)));
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(9 * values.size() / 10);
    std::nth_element(values.begin(), at, values.end());
    return *at;
  }

  Vectors velocities_, around_;
  const std::vector<double>& times_;
  Least least_;
  std::vector<double> speeds_, differences_, usual_difference_, usual_speed_;
};

class Search {
 public:
  explicit Search(const Trajectory& poses)
      : poses_(poses),
        times_(Times(poses)),
        translations_(Translations(), times_, kTranslation),
        rotations_(Rotations(), times_, kRotation) {}

  std::vector<OdometryJump> Find() const {
    const std::size_t steps = times_.size();
    std::vector<OdometryJump> jumps;
    std::size_t first = 0;  // pose of the stretch without a jump
    for (std::size_t i = 0; i < steps; ++i) {
      if (!Jumps(i, kBackTimesSpeed)) continue;
      if (const std::size_t back = Back(i); back > 0) {
        jumps.push_back(Between(i, back + 1, i, true));
        i = back;
      } else if (Jumps(i, kTimesSpeed)) {
        jumps.push_back(Between(i, i + 1, i, false));
        if (first == 0 && i < kOutliers && 3 * i < steps) {  // the poses before it are wrong
          jumps.assign(1, jumps.back());
          jumps.back().from_s = -std::numeric_limits<double>::infinity();
          jumps.back().comes_back = true;
        } else if (i + kOutliers >= steps && 3 * (steps - i) < steps) {
          jumps.back().to_s = std::numeric_limits<double>::infinity();
          jumps.back().comes_back = true;
          break;
        }
        first = i + 1;
      }
    }
    return jumps;
  }

 private:
  static std::vector<double> Times(const Trajectory& poses) {
    std::vector<double> times;
    for (std::size_t i = 1; i < poses.size(); ++i) times.push_back(poses[i].stamp_s - poses[i - 1].stamp_s);
    // Stamps that nearly repeat say nothing of a speed.
    const double least = 0.25 * internal::Median(times);
    for (double& time : times) time = std::max(time, least);
    return times;
  }
  Pose Step(std::size_t from, std::size_t to) const { return poses_[from].pose.Inverse() * poses_[to].pose; }
  Vectors Translations() const {
    Vectors out;
    for (std::size_t i = 0; i < times_.size(); ++i) out.push_back(Step(i, i + 1).translation / times_[i]);
    return out;
  }
  Vectors Rotations() const {
    Vectors out;
    for (std::size_t i = 0; i < times_.size(); ++i)
      out.push_back(LogSO3(Step(i, i + 1).rotation) / times_[i]);
    return out;
  }
  bool Jumps(std::size_t i, double times_speed) const {
    return translations_.Jumps(i, times_speed) || rotations_.Jumps(i, times_speed);
  }
  // The step that takes the jump of this one back; 0: none.
  std::size_t Back(std::size_t i) const {
    double time = times_[i];
    for (std::size_t j = i + 1; j < std::min(times_.size(), i + kOutliers + 1); ++j) {
      time += times_[j];
      if (!Jumps(j, kBackTimesSpeed)) continue;
      const Pose step = Step(i, j + 1);
      if (translations_.Fits(step.translation, time, i, j) &&
          rotations_.Fits(LogSO3(step.rotation), time, i, j))
        return j;
    }
    return 0;
  }
  OdometryJump Between(std::size_t from, std::size_t to, std::size_t step, bool comes_back) const {
    return {poses_[from].stamp_s, poses_[to].stamp_s, translations_.Jump(step), rotations_.Jump(step),
            comes_back};
  }

  const Trajectory& poses_;
  std::vector<double> times_;  // of the steps
  Velocities translations_, rotations_;
};

bool IsOutlier(double stamp_s, const std::vector<OdometryJump>& jumps) {
  return std::any_of(jumps.begin(), jumps.end(), [&](const OdometryJump& jump) {
    return jump.comes_back && jump.from_s < stamp_s && stamp_s < jump.to_s;
  });
}

}  // namespace

std::vector<OdometryJump> FindJumps(const Trajectory& trajectory) {
  if (trajectory.size() <= kFewest) return {};
  return Search(trajectory).Find();
}

Trajectory OnlyInliers(const Trajectory& trajectory, const std::vector<OdometryJump>& jumps) {
  Trajectory inliers;
  for (const StampedPose& pose : trajectory) {
    if (!IsOutlier(pose.stamp_s, jumps)) inliers.push_back(pose);
  }
  return inliers;
}

Trajectory WithoutOutliers(Trajectory trajectory, const std::vector<OdometryJump>& jumps) {
  const Trajectory good = OnlyInliers(trajectory, jumps);
  if (good.size() == trajectory.size() || good.empty()) return trajectory;
  std::size_t next = 0;  // of the good ones
  for (StampedPose& pose : trajectory) {
    while (next < good.size() && good[next].stamp_s < pose.stamp_s) ++next;
    if (next < good.size() && good[next].stamp_s == pose.stamp_s) continue;
    const StampedPose &before = good[next == 0 ? 0 : next - 1],
                      &after = good[std::min(next, good.size() - 1)];
    const double time = after.stamp_s - before.stamp_s;
    const double share = time > 0 ? (pose.stamp_s - before.stamp_s) / time : 0;
    pose.pose.translation = (1 - share) * before.pose.translation + share * after.pose.translation;
    pose.pose.rotation = before.pose.rotation.slerp(share, after.pose.rotation);
  }
  return trajectory;
}

std::string Sentence(const OdometryJump& jump) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  char size[80], when[120];
  std::snprintf(size, sizeof size, "the odometry jumps by %.3g m and %.3g deg", jump.distance_m,
                jump.angle_rad * internal::kDegrees);
  const char* const left_out = "; its poses in between are replaced";
  if (jump.from_s == -kInfinity) {
    std::snprintf(when, sizeof when, " to %.6f s; its poses before that are replaced", jump.to_s);
  } else if (jump.to_s == kInfinity) {
    std::snprintf(when, sizeof when, " after %.6f s; its poses from there on are replaced", jump.from_s);
  } else {
    std::snprintf(when, sizeof when, " %s %.6f s and %.6f s%s",
                  jump.comes_back ? "and back between" : "between", jump.from_s, jump.to_s,
                  jump.comes_back ? left_out : "; this step has no weight");
  }
  return std::string(size) + when;
}

std::vector<OdometryJump> JumpWatch::Take(bool all) {
  constexpr std::size_t kEvery = 8, kKept = 2 * kUsual, kMost = 2 * kKept;  // poses
  if (!all && recent_.size() < looked_at_ + kEvery) return {};
  looked_at_ = recent_.size();
  // The steps after a jump are those that it is compared with.
  const std::size_t unknown = all ? 0 : kAround + kOutliers;
  if (recent_.size() <= unknown) return {};
  const double known_s = recent_[recent_.size() - 1 - unknown].stamp_s;
  std::vector<OdometryJump> found = FindJumps(recent_);
  found.erase(std::remove_if(found.begin(), found.end(),
                             [&](const OdometryJump& jump) {
                               const double end_s = std::isfinite(jump.to_s) ? jump.to_s : jump.from_s;
                               return end_s <= told_s_ || (!all && end_s > known_s) ||
                                      (!std::isfinite(jump.to_s) && !all) ||
                                      (!std::isfinite(jump.from_s) && !begins_);
                             }),
              found.end());
  told_s_ = known_s;
  if (recent_.size() > kMost) {
    recent_.erase(recent_.begin(), recent_.end() - static_cast<std::ptrdiff_t>(kKept));
    looked_at_ = recent_.size();
    begins_ = false;
  }
  return found;
}

}  // namespace tutti
