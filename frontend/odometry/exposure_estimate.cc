#include "frontend/odometry/exposure_estimate.h"

#include <algorithm>
#include <cstddef>

namespace tutti {
namespace {
constexpr double kForget = 0.9;
constexpr double kClearly = 0.5;  // of the difference without blur: sharp images, smoothed, lose some
}  // namespace

void ExposureEstimate::Add(const Misfits& misfits) {
  for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] = kForget * sum_[i] + misfits[i];
  known_ = true;
}

double ExposureEstimate::Seconds() const {
  if (!IsKnown()) return 0;
  const auto least = std::min_element(sum_.begin(), sum_.end());
  if (!(*least < kClearly * sum_[0])) return 0;
  const auto i = static_cast<std::size_t>(least - sum_.begin());
  double between = 0;
  if (i > 0 && i + 1 < sum_.size()) {  // the lowest point of a parabola through three
    const double curve = sum_[i - 1] - 2 * sum_[i] + sum_[i + 1];
    if (curve > 0) between = std::clamp(0.5 * (sum_[i - 1] - sum_[i + 1]) / curve, -0.5, 0.5);
  }
  const int at = static_cast<int>(i);
  return ImageAligner::Exposure(at) + between * (ImageAligner::Exposure(1) - ImageAligner::Exposure(0));
}

}  // namespace tutti
