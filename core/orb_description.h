// ORB's descriptors: which of two smoothed pixels is the brighter one, for 256 pairs around a corner.
// E. Rublee et al., "ORB: an efficient alternative to SIFT or SURF", ICCV 2011, section 4.
//
// The descriptors are cv::ORB's. That smooths with sums of floats, which are fused (rounded once for a
// product and a sum) where the processor can: elsewhere some pixels in a million are another grey level, and
// with them every pose of a run. Here they are fused everywhere.
//
// For the modules that link OpenCV; core itself does not. Not installed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "core/inner_loops.h"

namespace tutti::internal {
namespace orb_smoothing {  // what only OrbDescription needs

constexpr int kRadius = 3;  // [px]
constexpr int kTaps = 2 * kRadius + 1;
using Kernel = std::array<float, kTaps>;       // by value: nothing else may be where it is
using Rows = std::array<const float*, kTaps>;  // the middle one and its neighbours

// `from` points at the pixel kRadius to the left of the first one.
TUTTI_CHECKED_AS_A_WHOLE inline void SmoothRow(const std::uint8_t* __restrict from, Kernel kernel, int count,
                                               float* __restrict to) {
  CheckReadable(from, static_cast<std::size_t>(count) + 2 * kRadius);
  CheckWritable(to, static_cast<std::size_t>(count));
  const float* weights = kernel.data();
  for (int x = 0; x < count; ++x) {
    float sum = weights[0] * static_cast<float>(from[x]);
    for (int k = 1; k < kTaps; ++k) sum = __builtin_fmaf(weights[k], static_cast<float>(from[x + k]), sum);
    to[x] = sum;
  }
}

TUTTI_CHECKED_AS_A_WHOLE inline void SmoothColumn(const Rows& rows, Kernel kernel, int count,
                                                  std::uint8_t* __restrict to) {
  for (const float* row : rows) CheckReadable(row, static_cast<std::size_t>(count));
  CheckWritable(to, static_cast<std::size_t>(count));
  constexpr float kToEven = 8388608.0F;  // 2^23: floats from here on are whole, halves went to even
  const float *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3], *e = rows[4], *f = rows[5],
              *g = rows[6], *weights = kernel.data();
  for (int x = 0; x < count; ++x) {
    float sum = weights[3] * d[x];
    sum = __builtin_fmaf(e[x] + c[x], weights[4], sum);
    sum = __builtin_fmaf(f[x] + b[x], weights[5], sum);
    sum = __builtin_fmaf(g[x] + a[x], weights[6], sum);
    const int grey = static_cast<int>((sum + kToEven) - kToEven);
    to[x] = static_cast<std::uint8_t>(grey < 255 ? grey : 255);
  }
}

struct Smoothing {
  void (*row)(const std::uint8_t*, Kernel, int, float*);
  void (*column)(const Rows&, Kernel, int, std::uint8_t*);
};

#if defined(__x86_64__)
#define TUTTI_FUSES __attribute__((target("avx2,fma"), flatten)) TUTTI_CHECKED_AS_A_WHOLE
TUTTI_FUSES inline void FusedRow(const std::uint8_t* from, Kernel kernel, int count, float* to) {
  SmoothRow(from, kernel, count, to);
}
TUTTI_FUSES inline void FusedColumn(const Rows& rows, Kernel kernel, int count, std::uint8_t* to) {
  SmoothColumn(rows, kernel, count, to);
}
#undef TUTTI_FUSES
#endif

// By what OpenCV may use, so that OPENCV_CPU_DISABLE and cv::setUseOptimized(false) choose the one in which
// the C library fuses: the same bits, slowly.
inline Smoothing Chosen() {
#if defined(__x86_64__)
  if (cv::checkHardwareSupport(CV_CPU_AVX2) && cv::checkHardwareSupport(CV_CPU_FMA3))
    return {FusedRow, FusedColumn};
#endif
  return {SmoothRow, SmoothColumn};
}

// By a Gaussian of 2 px over 7 px, without what lies `rim` or less from the border: `to` has that size. With
// no rim the image is mirrored at its border (BORDER_REFLECT_101).
inline void Smooth(const cv::Mat& from, int rim, cv::Mat& to) {
  CV_Assert(rim == 0 || rim >= kRadius);
  const cv::Mat weights = cv::getGaussianKernel(kTaps, 2, CV_32F);
  Kernel kernel;
  for (int k = 0; k < kTaps; ++k) kernel[static_cast<std::size_t>(k)] = weights.at<float>(k);
  const Smoothing smoothing = Chosen();
  const int rows = to.rows, columns = to.cols;
  std::vector<std::uint8_t> line(static_cast<std::size_t>(columns) + 2 * kRadius);  // with what is mirrored
  cv::Mat across(kTaps, columns, CV_32FC1);  // the last rows, each in its number modulo kTaps
  const auto at = [&across](int row) { return across.ptr<float>((row + kTaps) % kTaps); };
  const auto mirrored = [](int i, int count) {
    return cv::borderInterpolate(i, count, cv::BORDER_REFLECT_101);
  };
  for (int next = -kRadius; next < rows + kRadius; ++next) {
    const std::uint8_t* source = nullptr;  // kRadius to the left of the first
    if (rim > 0) {
      source = from.ptr<std::uint8_t>(next + rim) + rim - kRadius;
    } else {
      const auto* row = from.ptr<std::uint8_t>(mirrored(next, rows));
      std::copy(row, row + columns, line.begin() + kRadius);
      for (int i = 1; i <= kRadius; ++i) {
        line[static_cast<std::size_t>(kRadius - i)] = row[mirrored(-i, columns)];
        line[line.size() - 1 - static_cast<std::size_t>(kRadius - i)] =
            row[mirrored(columns - 1 + i, columns)];
      }
      source = line.data();
    }
    smoothing.row(source, kernel, columns, at(next));
    const int middle = next - kRadius;
    if (middle < 0) continue;
    Rows around{};
    for (int k = 0; k < kTaps; ++k) around[static_cast<std::size_t>(k)] = at(middle - kRadius + k);
    smoothing.column(around, kernel, columns, to.ptr<std::uint8_t>(middle));
  }
}

}  // namespace orb_smoothing

/// A level of a pyramid, smoothed, with descriptors of its corners.
class OrbDescription {
 public:
  static constexpr int kBytes = 32;   ///< of a descriptor
  static constexpr int kMargin = 19;  ///< how far from the image's rim a corner has to be [px]

  /// Smooths an 8-bit grey image, which may be gone afterwards. `rim`: what was put around it, 0 or at least
  /// 3 [px]; it is not smoothed itself, as in cv::ORB.
  explicit OrbDescription(const cv::Mat& image, int rim = 0) {
    if (rim > 0) {
      smooth_ = image.clone();
    } else {
      smooth_.create(image.size(), CV_8UC1);
    }
    cv::Mat inside = smooth_(cv::Rect(rim, rim, image.cols - 2 * rim, image.rows - 2 * rim));
    orb_smoothing::Smooth(image, rim, inside);
  }

  /// Writes kBytes of the corner at this pixel, whose orientation is `angle_deg` (IntensityCentroid).
  void Describe(int x, int y, float angle_deg, std::uint8_t* descriptor) const {
    const float angle = angle_deg * static_cast<float>(CV_PI / 180.0);
    const float c = static_cast<float>(std::cos(static_cast<double>(angle))),
                s = static_cast<float>(std::sin(static_cast<double>(angle)));
    const Pattern& pattern = OrbPattern();
    const int step = static_cast<int>(smooth_.step);
    std::array<int, kEnds> offset;  // of the pairs' turned ends from the corner [bytes]
    std::array<int, cv::v_int32x4::nlanes> columns{}, rows{};
    const cv::v_float32x4 cosine = cv::v_setall_f32(c), sine = cv::v_setall_f32(s);
    for (std::size_t i = 0; i < kEnds; i += columns.size()) {
      const cv::v_float32x4 x_end = cv::v_load(pattern.x.data() + i),
                            y_end = cv::v_load(pattern.y.data() + i);
      cv::v_store(columns.data(), cv::v_round(x_end * cosine - y_end * sine));
      cv::v_store(rows.data(), cv::v_round(x_end * sine + y_end * cosine));
      for (std::size_t lane = 0; lane < columns.size(); ++lane)
        offset[i + lane] = rows[lane] * step + columns[lane];
    }
    const std::uint8_t* corner = smooth_.ptr<std::uint8_t>(y) + x;
    constexpr int kSide = 2 * kMargin + 1;
    CheckReadableRows(corner - kMargin * step - kMargin, kSide, step, kSide);
    CheckWritable(descriptor, kBytes);
    Compare(corner, offset.data(), descriptor);
  }

 private:
  static constexpr std::size_t kEnds = 2 * 8 * kBytes;  // of all pairs
  struct Pattern {
    std::array<float, kEnds> x{}, y{};  // first and second end of each pair in turn [px]
  };

  // Bit by bit: is the first end darker than the second?
  TUTTI_CHECKED_AS_A_WHOLE static void Compare(const std::uint8_t* corner, const int* offset,
                                               std::uint8_t* descriptor) {
    for (int byte = 0; byte < kBytes; ++byte) {
      unsigned bits = 0;
      for (unsigned bit = 0; bit < 8; ++bit, offset += 2)
        bits |= static_cast<unsigned>(corner[offset[0]] < corner[offset[1]]) << bit;
      descriptor[byte] = static_cast<std::uint8_t>(bits);
    }
  }

  // The pairs that the paper's authors learned, as cv::ORB has them. It is asked for them: where one pixel
  // differs by so little that smoothing leaves of it one grey level at its own place alone, a bit is set if
  // that is the end that has to be the brighter one.
  static const Pattern& OrbPattern() {
    static const Pattern pattern = [] {
      constexpr int kReach = 15, kOffsets = 2 * kReach + 1, kCell = 2 * kReach + 2;  // [px]
      constexpr int kGrey = 100, kSpeck = 11;  // the speck's middle is smoothed to 0.51, next to it to 0.45
      std::vector<cv::KeyPoint> corners;
      cv::Mat dark(kOffsets * kCell, kOffsets * kCell, CV_8UC1, cv::Scalar(kGrey)), bright = dark.clone();
      for (int i = 0; i < kOffsets * kOffsets; ++i) {
        const int dx = i % kOffsets - kReach, dy = i / kOffsets - kReach;
        const cv::Point corner(i % kOffsets * kCell + kCell / 2, i / kOffsets * kCell + kCell / 2);
        dark.at<std::uint8_t>(corner.y + dy, corner.x + dx) = kGrey - kSpeck;
        bright.at<std::uint8_t>(corner.y + dy, corner.x + dx) = kGrey + kSpeck;
        corners.emplace_back(cv::Point2f(corner), 31.0F, 0.0F);
      }
      Pattern found;
      const cv::Ptr<cv::ORB> orb = cv::ORB::create(1, 1.2F, 1, kReach);
      for (const std::size_t end : {0, 1}) {  // the darker one, the brighter one
        cv::Mat bits;
        orb->compute(end == 0 ? dark : bright, corners, bits);
        CV_Assert(bits.rows == kOffsets * kOffsets && bits.cols == kBytes);
        int ends = 0;
        for (int i = 0; i < bits.rows; ++i) {
          const int x = i % kOffsets - kReach, y = i / kOffsets - kReach;
          for (int pair = 0; pair < 8 * kBytes; ++pair) {
            if ((bits.at<std::uint8_t>(i, pair / 8) >> (pair % 8) & 1) == 0) continue;
            found.x[2 * static_cast<std::size_t>(pair) + end] = static_cast<float>(x);
            found.y[2 * static_cast<std::size_t>(pair) + end] = static_cast<float>(y);
            ++ends;
          }
        }
        CV_Assert(ends == 8 * kBytes);
      }
      return found;
    }();
    return pattern;
  }

  cv::Mat smooth_;
};

}  // namespace tutti::internal
