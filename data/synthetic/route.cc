#include <algorithm>
#include <cmath>

#include "data/synthetic/scene.h"

namespace tutti::synthetic {

std::vector<Eigen::Vector2d> SmoothLoop(const std::vector<Eigen::Vector2d>& corners, double step_m,
                                        double rounding_m) {
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const int steps = std::max(1, static_cast<int>(std::round((b - a).norm() / step_m)));
    for (int k = 0; k < steps; ++k) points.push_back(a + (b - a) * k / steps);
  }
  const int n = static_cast<int>(points.size());
  const int half = std::clamp(static_cast<int>(rounding_m / step_m / 2), 1, std::max(1, n / 2 - 1));
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<Eigen::Vector2d> mean(points.size());
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    const auto at = [&](int i) { return points[static_cast<std::size_t>(((i % n) + n) % n)]; };
    for (int i = -half; i <= half; ++i) sum += at(i);
    for (int i = 0; i < n; ++i) {
      mean[static_cast<std::size_t>(i)] = sum / (2 * half + 1);
      sum += at(i + half + 1) - at(i - half);
    }
    points = std::move(mean);
  }
  return points;
}

Route::Route(std::vector<Eigen::Vector2d> points, double speed_mps, double max_yaw_rate,
             double max_acceleration) {
  // Even spacing again: rounding a corner makes the way shorter.
  const std::size_t count = points.size();
  std::vector<double> at(count + 1, 0.0);
  for (std::size_t i = 0; i < count; ++i) at[i + 1] = at[i] + (points[(i + 1) % count] - points[i]).norm();
  length_ = at.back();
  step_ = length_ / static_cast<double>(count);
  points_.resize(count);
  for (std::size_t i = 0, k = 0; i < count; ++i) {
    const double s = step_ * static_cast<double>(i);
    while (at[k + 1] < s) ++k;
    const double t = (s - at[k]) / std::max(at[k + 1] - at[k], 1e-12);
    points_[i] = points[k] + t * (points[(k + 1) % count] - points[k]);
  }
  std::vector<double> speed(count, speed_mps);
  for (std::size_t i = 0; i < count; ++i) {
    const double s = step_ * static_cast<double>(i);
    const double turn = std::remainder(HeadingAt(s + 0.5) - HeadingAt(s - 0.5), 2 * M_PI);  // over one metre
    speed[i] = std::min(speed_mps, max_yaw_rate / std::max(std::abs(turn), 1e-9));
  }
  // Twice around in each direction: the way is closed.
  const double gain = 2 * max_acceleration * step_;
  for (std::size_t k = 0; k < 2 * count; ++k) {
    const std::size_t i = k % count, next = (i + 1) % count;
    speed[next] = std::min(speed[next], std::sqrt(speed[i] * speed[i] + gain));
    const std::size_t j = count - 1 - i, before = (j + count - 1) % count;
    speed[before] = std::min(speed[before], std::sqrt(speed[j] * speed[j] + gain));
  }
  time_.assign(count + 1, 0.0);
  for (std::size_t i = 0; i < count; ++i)
    time_[i + 1] = time_[i] + 2 * step_ / (speed[i] + speed[(i + 1) % count]);
}

double Route::DistanceAt(double time_s) const {
  const double laps = std::floor(time_s / LapTime());
  const double t = std::clamp(time_s - laps * LapTime(), 0.0, LapTime());
  const auto next = std::upper_bound(time_.begin() + 1, time_.end() - 1, t);
  const std::size_t i = static_cast<std::size_t>(next - time_.begin()) - 1;
  const double part = (t - time_[i]) / (time_[i + 1] - time_[i]);
  return laps * length_ + step_ * (static_cast<double>(i) + part);
}

Eigen::Vector2d Route::PointAt(double distance_m) const {
  const double wrapped = distance_m - std::floor(distance_m / length_) * length_;
  const double at = wrapped / step_;
  const std::size_t i = std::min(static_cast<std::size_t>(at), points_.size() - 1);
  const double part = at - static_cast<double>(i);
  return points_[i] + part * (points_[(i + 1) % points_.size()] - points_[i]);
}

double Route::HeadingAt(double distance_m) const {
  // A chord of a metre (or a hundredth of the lap): the heading has no steps at the points.
  const double reach = std::min(0.5, 0.005 * length_);
  const Eigen::Vector2d d = PointAt(distance_m + reach) - PointAt(distance_m - reach);
  return std::atan2(d.y(), d.x());
}

}  // namespace tutti::synthetic
