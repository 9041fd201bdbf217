#include "frontend/imu/gyro_track.h"

#include <algorithm>
#include <cmath>

#include "tutti/core/pose.h"

namespace tutti {
namespace {
constexpr double kGap = 0.06;  // longer, the turning between two measurements is unknown [s]
}  // namespace

void GyroTrack::Add(const ImuSample& sample) {
  Knot knot{sample.stamp_s, sample.gyro, Eigen::Quaterniond::Identity(), sample.acceleration};
  if (!knots_.empty()) {
    const Knot& last = knots_.back();
    const double dt = sample.stamp_s - last.stamp_s;
    if (!(dt > 0)) return;
    knot.turned = (last.turned * ExpSO3(0.5 * dt * (last.gyro + sample.gyro))).normalized();
  }
  knots_.push_back(knot);
}

void GyroTrack::ForgetBefore(double stamp_s) {
  while (knots_.size() > 2 && knots_[1].stamp_s < stamp_s) knots_.pop_front();
}

std::size_t GyroTrack::Before(double stamp_s) const {
  const auto next = std::upper_bound(knots_.begin(), knots_.end(), stamp_s,
                                     [](double stamp, const Knot& knot) { return stamp < knot.stamp_s; });
  if (next == knots_.begin() || next == knots_.end()) return knots_.size();
  const auto before = next - 1;
  return next->stamp_s - before->stamp_s > kGap ? knots_.size()
                                                : static_cast<std::size_t>(before - knots_.begin());
}

Eigen::Vector3d GyroTrack::Within(std::size_t knot, double from_s, double to_s) const {
  const Knot &a = knots_[knot], &b = knots_[knot + 1];
  const double middle = (0.5 * (from_s + to_s) - a.stamp_s) / (b.stamp_s - a.stamp_s);
  return (to_s - from_s) * (a.gyro + middle * (b.gyro - a.gyro));
}

std::optional<Eigen::Quaterniond> GyroTrack::Turned(double from_s, double to_s) const {
  const std::size_t first = Before(from_s), last = Before(to_s);
  if (first == knots_.size() || last == knots_.size()) return std::nullopt;
  const Eigen::Quaterniond from = knots_[first].turned * ExpSO3(Within(first, knots_[first].stamp_s, from_s));
  return (from.conjugate() * knots_[last].turned * ExpSO3(Within(last, knots_[last].stamp_s, to_s)))
      .normalized();
}

std::optional<Eigen::Quaterniond> GyroTrack::Turned(double from_s, double to_s,
                                                    const Eigen::Vector3d& bias) const {
  const std::size_t first = Before(from_s), last = Before(to_s);
  if (first == knots_.size() || last == knots_.size() || !(from_s <= to_s)) return std::nullopt;
  Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
  for (std::size_t k = first; k <= last; ++k) {
    const double begin = std::max(from_s, knots_[k].stamp_s), end = std::min(to_s, knots_[k + 1].stamp_s);
    if (knots_[k + 1].stamp_s - knots_[k].stamp_s > kGap) return std::nullopt;
    turned = turned * ExpSO3(Within(k, begin, end) - (end - begin) * bias);
  }
  return turned.normalized();
}

std::optional<Eigen::Vector3d> GyroTrack::VelocityGained(double from_s, double to_s,
                                                         const Eigen::Vector3d& gyro_bias) const {
  const std::size_t first = Before(from_s), last = Before(to_s);
  if (first == knots_.size() || last == knots_.size() || !(from_s <= to_s)) return std::nullopt;
  Eigen::Quaterniond turned = Eigen::Quaterniond::Identity();
  Eigen::Vector3d gained = Eigen::Vector3d::Zero();
  for (std::size_t k = first; k <= last; ++k) {
    const Knot &a = knots_[k], &b = knots_[k + 1];
    if (b.stamp_s - a.stamp_s > kGap) return std::nullopt;
    const double begin = std::max(from_s, a.stamp_s), end = std::min(to_s, b.stamp_s);
    const double middle = 0.5 * (begin + end);
    const Eigen::Quaterniond half = ExpSO3(Within(k, begin, middle) - (middle - begin) * gyro_bias);
    const Eigen::Vector3d acceleration =
        a.acceleration + (middle - a.stamp_s) / (b.stamp_s - a.stamp_s) * (b.acceleration - a.acceleration);
    gained += (end - begin) * (turned * (half * acceleration));
    turned = (turned * ExpSO3(Within(k, begin, end) - (end - begin) * gyro_bias)).normalized();
  }
  return gained;
}

std::optional<double> GyroTrack::MeanRate(double from_s, double to_s) const {
  const std::size_t first = Before(from_s), last = Before(to_s);
  if (first == knots_.size() || last == knots_.size()) return std::nullopt;
  double sum = 0;
  for (std::size_t k = first; k <= last; ++k) sum += knots_[k].gyro.norm();
  return sum / static_cast<double>(last - first + 1);
}

bool GyroTrack::IsPossible() const {
  for (std::size_t k = 0; k < knots_.size(); ++k) {
    const Knot& knot = knots_[k];
    if (!std::isfinite(knot.stamp_s) || !knot.gyro.allFinite() || !knot.acceleration.allFinite() ||
        !knot.turned.coeffs().allFinite())
      return false;
    if (k > 0 && !(knot.stamp_s > knots_[k - 1].stamp_s)) return false;
  }
  return true;
}

}  // namespace tutti
