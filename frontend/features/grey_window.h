// What the alignments of patches share: weighted windows and sub-pixel grey values.
#pragma once

#include <Eigen/Core>
#include <array>
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
/// are `step` bytes apart. Checked by a sanitizer where it is called, or there as a whole.
__attribute__((always_inline)) inline float Bilinear(const std::uint8_t* data, std::size_t step, float x,
                                                     float y) {
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const float ax = x - static_cast<float>(ix), ay = y - static_cast<float>(iy);
  const std::uint8_t* r0 = data + static_cast<std::size_t>(iy) * step + ix;
  const std::uint8_t* r1 = r0 + step;
  const float top = r0[0] + ax * static_cast<float>(r0[1] - r0[0]);
  const float bottom = r1[0] + ax * static_cast<float>(r1[1] - r1[0]);
  return top + ay * (bottom - top);
}

/// Bilinear at (x + u, y + v) for each pixel (u, v) of a window, to the bit. Each row of pixels is
/// interpolated along its length once, for the samples above and below it.
template <int Half>
void BilinearWindow(const std::uint8_t* data, std::size_t step, float x, float y, GreyWindow<Half>* grey) {
  constexpr int kSide = 2 * Half + 1;
  std::array<float, kSide> ax, ay;
  const int left = static_cast<int>(x - float(Half)), top = static_cast<int>(y - float(Half));
  bool side_by_side = true;  // not where a sum is rounded up to the next pixel
  for (int i = 0; i < kSide; ++i) {
    const float at_x = x + float(i - Half), at_y = y + float(i - Half);
    const int ix = static_cast<int>(at_x), iy = static_cast<int>(at_y);
    side_by_side &= ix == left + i && iy == top + i;
    ax[static_cast<std::size_t>(i)] = at_x - static_cast<float>(ix);
    ay[static_cast<std::size_t>(i)] = at_y - static_cast<float>(iy);
  }
  if (!side_by_side) {
    for (int v = -Half, n = 0; v <= Half; ++v) {
      for (int u = -Half; u <= Half; ++u, ++n) (*grey)(n) = Bilinear(data, step, x + float(u), y + float(v));
    }
    return;
  }
  std::array<float, kSide> above{}, below{};
  for (int v = 0; v <= kSide; ++v) {
    const std::uint8_t* row = data + static_cast<std::size_t>(top + v) * step + left;
    for (std::size_t u = 0; u < kSide; ++u)
      below[u] = row[u] + ax[u] * static_cast<float>(row[u + 1] - row[u]);
    if (v > 0) {
      float* out = grey->data() + (v - 1) * kSide;
      const float a = ay[static_cast<std::size_t>(v - 1)];
      for (std::size_t u = 0; u < kSide; ++u) out[u] = above[u] + a * (below[u] - above[u]);
    }
    above = below;
  }
}

}  // namespace tutti
