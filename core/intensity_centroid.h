// The orientation of a corner: from it to the centroid of the grey values around it.
// E. Rublee et al., "ORB: an efficient alternative to SIFT or SURF", ICCV 2011, section 3.2.
//
// For the modules that link OpenCV; core itself does not. Not installed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/core/hal/intrin.hpp>

namespace tutti::internal {

/// Orientation over a patch whose upper half mirrors the lower one. Sums are of whole numbers: exact.
class IntensityCentroid {
 public:
  static constexpr int kRadius = 15;  ///< of the patch [px]
  static constexpr int kMargin = 16;  ///< how far from the image's rim a corner has to be [px]
  using HalfWidths = std::array<int, kRadius + 1>;

  /// `widths`: for each row, from the middle one on, how far the patch goes to either side, at most kRadius
  /// [px].
  explicit IntensityCentroid(const HalfWidths& widths) {
    for (std::size_t row = 0; row < widths.size(); ++row) {
      for (int u = -widths[row]; u <= widths[row]; ++u) {
        const int column = u + kRadius;
        const auto at = static_cast<std::size_t>(column);
        one_[row][at] = 1;
        column_[row][at] = static_cast<std::int16_t>(u);
      }
    }
  }

  /// Orientation of the corner at this pixel of an 8-bit grey image [deg], 0 to 360 by cv::fastAtan2.
  float Angle(const cv::Mat& image, int x, int y) const {
    constexpr int kLanes = cv::v_int16x8::nlanes;
    cv::v_int32x4 across = cv::v_setzero_s32();
    int m01 = 0;
    for (int v = 0; v <= kRadius; ++v) {
      const std::uint8_t* below = image.ptr<std::uint8_t>(y + v) + x - kRadius;
      const std::uint8_t* above = image.ptr<std::uint8_t>(y - v) + x - kRadius;
      const auto row = static_cast<std::size_t>(v);
      cv::v_int32x4 down = cv::v_setzero_s32();
      for (int u = 0; u < kColumns; u += kLanes) {
        const cv::v_int16x8 b = cv::v_reinterpret_as_s16(cv::v_load_expand(below + u));
        const cv::v_int16x8 a = cv::v_reinterpret_as_s16(cv::v_load_expand(above + u));
        const cv::v_int16x8 both = v == 0 ? b : a + b;
        across = cv::v_dotprod(both, cv::v_load(column_[row].data() + u), across);
        down = cv::v_dotprod(b - a, cv::v_load(one_[row].data() + u), down);
      }
      m01 += v * cv::v_reduce_sum(down);
    }
    return cv::fastAtan2(static_cast<float>(m01), static_cast<float>(cv::v_reduce_sum(across)));
  }

 private:
  // Columns -15 .. 16 of each row, from the middle one on: 0 outside of the patch.
  static constexpr int kColumns = 32;
  using Rows = std::array<std::array<std::int16_t, kColumns>, kRadius + 1>;
  Rows one_{}, column_{};
};

}  // namespace tutti::internal
