#include "data/synthetic/hand.h"

#include <algorithm>
#include <cmath>

#include "data/synthetic/synthetic_random.h"

namespace tutti::synthetic {
namespace {
const Eigen::Vector3d kLever(0.03, -0.06, 0.19);  // wrist to camera, in the camera frame: 0.2 m
constexpr double kSlowestHz = 0.5, kFastestHz = 1.3;
constexpr double kMeasuredFor = 60, kStep = 0.005;  // where the fastest turning is looked for [s]
}  // namespace

Hand::Hand(std::uint64_t seed, double peak_deg_per_s) : peak_(peak_deg_per_s * M_PI / 180) {
  Random random(seed * 0x9E6C63D0ULL + 23);
  period_s_ = random.In(3.5, 5);
  for (Axis& axis : axes_) {
    for (std::size_t k = 0; k < kWaves; ++k) {
      axis.frequency_hz[k] = random.In(kSlowestHz, kFastestHz);
      axis.phase[k] = random.In(0, 2 * M_PI);
      axis.amplitude[k] = random.In(0.5, 1);
    }
    axis.scale = 1;
    double fastest = 0;
    for (double t = 0; peak_ > 0 && t < kMeasuredFor; t += kStep)
      fastest = std::max(fastest, std::abs(Angle(axis, t + kStep) - Angle(axis, t)) / kStep);
    axis.scale = fastest > 0 ? peak_ / fastest : 0;
  }
}

// 0 in calm moments, a good part of the time, to 1 in the middle of a burst.
double Hand::Burst(double time_s) const {
  const double wave = 0.5 - 0.5 * std::cos(2 * M_PI * time_s / period_s_);
  return wave * wave * (3 - 2 * wave);
}

double Hand::Angle(const Axis& axis, double time_s) const {
  double sum = 0;
  for (std::size_t k = 0; k < kWaves; ++k)
    sum += axis.amplitude[k] * std::sin(2 * M_PI * axis.frequency_hz[k] * time_s + axis.phase[k]);
  return axis.scale * Burst(time_s) * sum;
}

Pose Hand::At(double time_s) const {
  if (!(peak_ > 0)) return Pose();
  const Eigen::Quaterniond turned = Eigen::AngleAxisd(Angle(axes_[1], time_s), Eigen::Vector3d::UnitY()) *
                                    Eigen::AngleAxisd(Angle(axes_[0], time_s), Eigen::Vector3d::UnitX()) *
                                    Eigen::AngleAxisd(Angle(axes_[2], time_s), Eigen::Vector3d::UnitZ());
  return Pose(turned, turned * kLever - kLever);
}

}  // namespace tutti::synthetic
