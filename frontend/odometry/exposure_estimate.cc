#include "frontend/odometry/exposure_estimate.h"

#include <algorithm>
#include <cstddef>

namespace tutti {
namespace {
constexpr double kForget = 0.9;
constexpr double kClearly = 0.5;  // of the difference without blur: sharp images, smoothed, lose some
constexpr double kPerhaps = 0.75;
constexpr double kLong = 0.015;  // sharp images, smoothed a little, look like a shorter exposure [s]
}  // namespace

void ExposureEstimate::Add(const Misfits& misfits) {
  for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] = kForget * sum_[i] + misfits[i];
  known_ = true;
}

std::size_t ExposureEstimate::Likeliest() const {
  return static_cast<std::size_t>(std::min_element(sum_.begin(), sum_.end()) - sum_.begin());
}

bool ExposureEstimate::IsOpen() const {
  if (!known_) return true;
  const std::size_t i = Likeliest();
  return sum_[i] < kPerhaps * sum_[0] && sum_[i] >= kClearly * sum_[0] &&
         ImageAligner::Exposure(static_cast<int>(i)) >= kLong;
}

double ExposureEstimate::Seconds() const {
  if (!known_) return 0;
  const std::size_t i = Likeliest();
  if (!(sum_[i] < kClearly * sum_[0])) return 0;
  double between = 0;
  if (i > 0 && i + 1 < sum_.size()) {  // the lowest point of a parabola through three
    const double curve = sum_[i - 1] - 2 * sum_[i] + sum_[i + 1];
    if (curve > 0) between = std::clamp(0.5 * (sum_[i - 1] - sum_[i + 1]) / curve, -0.5, 0.5);
  }
  const int at = static_cast<int>(i);
  return ImageAligner::Exposure(at) + between * (ImageAligner::Exposure(1) - ImageAligner::Exposure(0));
}

}  // namespace tutti
