// What the alignments of patches share: weighted windows and sub-pixel grey values.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace tutti {

/// Grey values of the (2 Half + 1)^2 pixels around a centre, row by row.
template <int Half>
using GreyWindow = Eigen::Matrix<float, (2 * Half + 1) * (2 * Half + 1), 1>;

/// Gaussian weights of a window, which sum to 1.
template <int Half>
const GreyWindow<Half>& WindowWeights() {
  constexpr double kSigma = 3;  // [px]
  static const GreyWindow<Half> weights = [] {
    GreyWindow<Half> w;
    for (int v = -Half, n = 0; v <= Half; ++v) {
      for (int u = -Half; u <= Half; ++u, ++n)
        w(n) = static_cast<float>(std::exp(-0.5 * (u * u + v * v) / (kSigma * kSigma)));
    }
    return GreyWindow<Half>(w / w.sum());
  }();
  return weights;
}

/// Grey value between pixels; (x, y) and the pixels right of and below it must lie in the image, whose rows
/// are `step` bytes apart.
inline float Bilinear(const std::uint8_t* data, std::size_t step, float x, float y) {
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float ax = x - static_cast<float>(ix), ay = y - static_cast<float>(iy);
  const std::uint8_t* r0 = data + static_cast<std::size_t>(iy) * step + ix;
  const std::uint8_t* r1 = r0 + step;
  const float top = r0[0] + ax * static_cast<float>(r0[1] - r0[0]);
  const float bottom = r1[0] + ax * static_cast<float>(r1[1] - r1[0]);
  return top + ay * (bottom - top);
}

}  // namespace tutti
