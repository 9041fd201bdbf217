// Truth as a bad odometry would have it, and what is left of its drift where it comes back.
#pragma once

#include <cmath>
#include <random>

#include "tutti/core/trajectory.h"

namespace tutti::testing {

/// The steps of `truth` with a random walk of yaw (about the camera's y axis) and scale, each with this
/// standard deviation after one metre.
inline Trajectory Disturbed(const Trajectory& truth, double yaw_deg, double scale_percent,
                            std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Trajectory out = {truth.front()};
  double log_scale = 0;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    Pose step = truth[i - 1].pose.Inverse() * truth[i].pose;
    const double root = std::sqrt(step.translation.norm());
    log_scale += 0.01 * scale_percent * root * normal(random);
    const double yaw = yaw_deg * 0.017453292519943295 * root * normal(random);
    step.translation *= std::exp(log_scale);
    step.rotation = (step.rotation * ExpSO3({0, yaw, 0})).normalized();
    out.push_back({truth[i].stamp_s, out.back().pose * step});
  }
  return out;
}

/// How far the last pose is from where `truth` has it, seen from the pose that was nearest to it in the first
/// half [m].
inline double DriftAtTheEnd(const Trajectory& truth, const Trajectory& estimate) {
  std::size_t nearest = 0;
  const Eigen::Vector3d end = truth.back().pose.translation;
  for (std::size_t i = 0; i < truth.size() / 2; ++i) {
    if ((truth[i].pose.translation - end).norm() < (truth[nearest].pose.translation - end).norm())
      nearest = i;
  }
  const auto seen = [nearest](const Trajectory& t) {
    return Eigen::Vector3d(t[nearest].pose.Inverse() * t.back().pose.translation);
  };
  return (seen(truth) - seen(estimate)).norm();
}

}  // namespace tutti::testing
