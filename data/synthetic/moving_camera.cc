#include "data/synthetic/moving_camera.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "data/synthetic/synthetic_random.h"

namespace tutti::synthetic {
namespace {

const Eigen::Vector3d kLever(0.03, -0.06, 0.19);  // wrist to camera, in the camera frame: 0.2 m
constexpr double kSlowestHz = 0.5, kFastestHz = 1.3;
constexpr double kMeasuredFor = 60, kStep = 0.005;  // where the fastest turning is looked for [s]

constexpr int kStripRows = 4;

// The mean over the exposure around a time.
Rendering Mean(const PinholeCamera& camera, const Shutter& shutter, double time_s, const View& view) {
  const int steps = shutter.exposure_s > 0 ? shutter.samples : 1, middle = steps / 2;
  Rendering sum;
  for (int k = 0; k < steps; ++k) {
    const double at = time_s + (steps == 1 ? 0.0 : shutter.exposure_s * (k - middle) / double(steps));
    Rendering one = view(camera, at);
    if (k == 0) {
      sum = std::move(one);
    } else {
      sum.image += one.image;
      if (k == middle) sum.depth_m = one.depth_m;
    }
  }
  if (steps > 1) sum.image *= 1.0 / steps;
  return sum;
}

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

PinholeCamera RowsOf(const PinholeCamera& camera, int first, int rows) {
  PinholeCamera part = camera;
  part.cy = camera.cy - first;
  part.height = rows;
  return part;
}

Rendering Expose(const PinholeCamera& camera, const Shutter& shutter, double time_s, const View& view) {
  if (!(shutter.readout_s > 0)) return Mean(camera, shutter, time_s, view);
  Rendering whole;
  whole.image.create(camera.height, camera.width, CV_32FC1);
  whole.depth_m.create(camera.height, camera.width, CV_32FC1);
  const double last = camera.height - 1;
  for (int first = 0; first < camera.height; first += kStripRows) {
    const int rows = std::min(kStripRows, camera.height - first);
    const double late = shutter.readout_s * ((first + 0.5 * (rows - 1)) / last - 0.5);
    const Rendering strip = Mean(RowsOf(camera, first, rows), shutter, time_s + late, view);
    strip.image.copyTo(whole.image.rowRange(first, first + rows));
    strip.depth_m.copyTo(whole.depth_m.rowRange(first, first + rows));
  }
  return whole;
}

}  // namespace tutti::synthetic
