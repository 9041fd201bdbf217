#include "apps/slam/odometry_uncertainty.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/numbers.h"

namespace tutti {
namespace {

constexpr std::size_t kWindows = 8;   // that a standard deviation takes, without overlap
constexpr std::size_t kLongest = 16;  // window [keyframes]
// Of a step's length: on short steps, what the images err by themselves looks like more, and a map that gives
// way to that takes false loops, too.
constexpr double kMostFraction = 0.05;
constexpr double kSigmaOfMedian = 1.4826;  // a normal distribution's, by the median of its absolute values

using Values = std::array<std::vector<double>, 3>;  // absolute values by axis

// What is left of the largest axis when what the images themselves err by is taken out.
double WorstSigma(Values* values, double own_sigma) {
  double worst = 0;
  for (std::vector<double>& axis : *values)
    worst = std::max(worst, kSigmaOfMedian * internal::Median(std::move(axis)));
  return std::sqrt(std::max(0.0, worst * worst - own_sigma * own_sigma));
}

}  // namespace

OdometryUncertainty::Sigmas OdometryUncertainty::Over(std::size_t window) const {
  Values shares, rotations;
  std::vector<double> own_shares, own_rotations;
  for (std::size_t first = 0; first + window <= checks_.size(); ++first) {
    Eigen::Vector3d translation = Eigen::Vector3d::Zero(), rotation = Eigen::Vector3d::Zero();
    double squared_way = 0;
    for (std::size_t i = first; i < first + window; ++i) {
      translation += checks_[i].translation_m;
      rotation += checks_[i].rotation_rad;
      squared_way += checks_[i].way_m * checks_[i].way_m;
    }
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<std::size_t>(axis);
      rotations[a].push_back(std::abs(rotation[axis]) / std::sqrt(static_cast<double>(window)));
      if (squared_way > 0) shares[a].push_back(std::abs(translation[axis]) / std::sqrt(squared_way));
    }
    own_rotations.push_back(checks_[first].sigma_rotation_rad);
    if (checks_[first].way_m > 0)
      own_shares.push_back(checks_[first].sigma_translation_m / checks_[first].way_m);
  }
  return {WorstSigma(&shares, internal::Median(std::move(own_shares))),
          WorstSigma(&rotations, internal::Median(std::move(own_rotations)))};
}

OdometryUncertainty::Sigmas OdometryUncertainty::Estimate() const {
  Sigmas largest;
  for (std::size_t window = 1; window <= kLongest && kWindows * window <= checks_.size(); window *= 2) {
    const Sigmas sigmas = Over(window);
    largest.fraction = std::max(largest.fraction, sigmas.fraction);
    largest.rotation_rad = std::max(largest.rotation_rad, sigmas.rotation_rad);
  }
  largest.fraction = std::min(largest.fraction, kMostFraction);
  return largest;
}

}  // namespace tutti
