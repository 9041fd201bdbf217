// Gradients as length and direction. Internal.
//
// Those of OpenCV (cv::hal::magnitude32f, fastAtan32f) fuse multiplications and additions where the processor
// can, and have other last bits there. These do not.
#pragma once

#include <cstddef>
#include <opencv2/core/hal/intrin.hpp>

#include "core/numbers.h"

namespace tutti::internal {

constexpr std::size_t kPolarLanes = 4;

/// Room for `count` gradients in the arrays of Polar.
constexpr std::size_t RoomForPolar(std::size_t count) {
  return (count + kPolarLanes - 1) / kPolarLanes * kPolarLanes;
}

/// Lengths and directions [deg, 0 to 360] of `count` gradients. All arrays have RoomForPolar(count) elements.
/// The arc tangent is the odd polynomial of degree 7 of cv::fastAtan2, off by at most 0.02 degrees.
inline void Polar(const float* dx, const float* dy, std::size_t count, float* length, float* angle_deg) {
  using Lanes = cv::v_float32x4;
  const auto all = [](double value) { return cv::v_setall_f32(static_cast<float>(value)); };
  const Lanes p1 = all(0.9997878412794807 * kDegrees), p3 = all(-0.3258083974640975 * kDegrees),
              p5 = all(0.1555786518463281 * kDegrees), p7 = all(-0.04432655554792128 * kDegrees),
              least = all(2.220446049250313e-16), zero = all(0);
  for (std::size_t i = 0; i < count; i += kPolarLanes) {
    const Lanes x = cv::v_load(dx + i), y = cv::v_load(dy + i);
    cv::v_store(length + i, cv::v_sqrt(x * x + y * y));
    const Lanes across = cv::v_abs(x), down = cv::v_abs(y);
    const Lanes c = cv::v_min(across, down) / (cv::v_max(across, down) + least), c2 = c * c;
    Lanes angle = (((p7 * c2 + p5) * c2 + p3) * c2 + p1) * c;  // of the eighth of the circle, from its axis
    angle = cv::v_select(down > across, all(90) - angle, angle);
    angle = cv::v_select(x < zero, all(180) - angle, angle);
    cv::v_store(angle_deg + i, cv::v_select(y < zero, all(360) - angle, angle));
  }
}

}  // namespace tutti::internal
