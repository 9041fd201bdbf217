// FAST: corners that nine neighbouring pixels of a circle around them are all brighter, or all darker, than.
// E. Rosten, T. Drummond, "Machine learning for high-speed corner detection", ECCV 2006.
//
// For the modules that link OpenCV; core itself does not. Not installed.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/features2d.hpp>
#include <vector>

namespace tutti::internal {
namespace fast {  // what only FastCorners needs

using Pixel = std::uint8_t;
using Lanes = cv::v_uint8x16;

constexpr int kRadius = 3;  // [px]
constexpr int kRows = 2 * kRadius + 1;
constexpr std::size_t kRingPixels = 16;     // pixels of the circle
constexpr int kPixelLanes = Lanes::nlanes;  // pixels that are looked at at once
using Rows = std::array<const Pixel*, kRows>;
using Circle = std::array<Lanes, kRingPixels>;

// The pixels at the same place of the circle around each.
inline Circle CircleAround(const Rows& rows, int x) {
  const auto at = [&](int dx, int dy) {
    const int row = kRadius + dy;
    return cv::v_load(rows[static_cast<std::size_t>(row)] + x + dx);
  };
  return {at(0, 3),  at(1, 3),   at(2, 2),   at(3, 1),   at(3, 0),  at(3, -1), at(2, -2), at(1, -3),
          at(0, -3), at(-1, -3), at(-2, -2), at(-3, -1), at(-3, 0), at(-3, 1), at(-2, 2), at(-1, 3)};
}

// Whether one of them may be a corner: of each fourth pixel of the circle an arc of nine holds two in a row.
inline bool MayBeCorner(const Rows& rows, int x, const Lanes& here, const Lanes& threshold) {
  const auto at = [&](int dx, int dy) {
    const int row = kRadius + dy;
    return cv::v_load(rows[static_cast<std::size_t>(row)] + x + dx);
  };
  const Lanes n = at(0, -3), s = at(0, 3), w = at(-3, 0), e = at(3, 0);
  const Lanes nw = at(-2, -2), ne = at(2, -2), sw = at(-2, 2), se = at(2, 2);
  const Lanes bright =
      cv::v_min(cv::v_min(cv::v_max(n, s), cv::v_max(w, e)), cv::v_min(cv::v_max(nw, se), cv::v_max(ne, sw)));
  const Lanes dark =
      cv::v_max(cv::v_max(cv::v_min(n, s), cv::v_min(w, e)), cv::v_max(cv::v_min(nw, se), cv::v_min(ne, sw)));
  return cv::v_check_any(cv::v_max(bright - here, here - dark) > threshold);
}

// The least difference of each arc of nine, and the greatest of these.
inline Lanes OfBestArc(const Circle& difference) {
  const auto at = [&difference](std::size_t k) -> const Lanes& { return difference[k % kRingPixels]; };
  std::array<Lanes, kRingPixels / 2> two, four;  // least of so many in a row, from each odd one on
  for (std::size_t k = 0; k < two.size(); ++k) two[k] = cv::v_min(at(2 * k + 1), at(2 * k + 2));
  for (std::size_t k = 0; k < two.size(); ++k) four[k] = cv::v_min(two[k], two[(k + 1) % two.size()]);
  // The arcs that begin one earlier and end one later share eight.
  Lanes best = cv::v_setzero_u8();
  for (std::size_t k = 0; k < two.size(); ++k) {
    const Lanes eight = cv::v_min(four[k], four[(k + 2) % two.size()]);
    best = cv::v_max(best, cv::v_min(eight, cv::v_max(at(2 * k), at(2 * k + 9))));
  }
  return best;
}

// The greatest threshold at which each still is a corner; 0 where it is none.
inline Lanes Scores(const Rows& rows, int x, const Lanes& here, const Lanes& threshold) {
  const Circle around = CircleAround(rows, x);
  Circle difference;
  for (std::size_t k = 0; k < kRingPixels; ++k)
    difference[k] = around[k] - here;  // 0 where it would be negative
  Lanes best = OfBestArc(difference);
  for (std::size_t k = 0; k < kRingPixels; ++k) difference[k] = here - around[k];
  best = cv::v_max(best, OfBestArc(difference));
  return (best & (best > threshold)) - cv::v_setall_u8(1);
}

// From each first place of a row of lanes; the last ones overlap.
template <class Visit>
void ForLanes(int cols, const Visit& visit) {
  const int last = cols - kRadius - kPixelLanes;
  for (int x = kRadius; x < last; x += kPixelLanes) visit(x);
  visit(last);
}

inline void ScoreRow(const Rows& rows, int cols, Pixel threshold, Pixel* scores) {
  const Lanes above = cv::v_setall_u8(threshold);
  ForLanes(cols, [&](int x) {
    const Lanes here = cv::v_load(rows[kRadius] + x);
    const bool none = !MayBeCorner(rows, x, here, above);
    cv::v_store(scores + x, none ? cv::v_setzero_u8() : Scores(rows, x, here, above));
  });
}

// Adds the corners of a row that are stronger than the eight pixels around them.
inline void AddStrongest(const Pixel* above, const Pixel* here, const Pixel* below, int cols, int row,
                         std::vector<cv::KeyPoint>& corners) {
  int next = 0;
  ForLanes(cols, [&](int x) {
    const Lanes scores = cv::v_load(here + x);
    if (!cv::v_check_any(scores > cv::v_setzero_u8())) return;
    Lanes around = cv::v_max(cv::v_load(here + x - 1), cv::v_load(here + x + 1));
    for (const Pixel* line : {above, below}) {
      around = cv::v_max(around, cv::v_max(cv::v_load(line + x),
                                           cv::v_max(cv::v_load(line + x - 1), cv::v_load(line + x + 1))));
    }
    for (auto strongest = static_cast<unsigned>(cv::v_signmask(scores > around)); strongest != 0;
         strongest &= strongest - 1) {
      const int column = x + __builtin_ctz(strongest);
      if (column < next) continue;  // seen in the lanes before
      next = column + 1;
      corners.emplace_back(static_cast<float>(column), static_cast<float>(row), 7.0F, -1.0F,
                           static_cast<float>(here[column]));
    }
  });
}

/// What cv::FAST(image, corners, threshold, true) finds in an 8-bit grey image (16 pixels around, 9 in a row,
/// those next to a stronger one left out), in the same order: by row, then by column; none above 255. In a
/// fraction of its time: scores are computed for many corners at once.
inline std::vector<cv::KeyPoint> FastCorners(const cv::Mat& image, int threshold) {
  std::vector<cv::KeyPoint> corners;
  threshold = std::clamp(threshold, 0, 255);
  if (image.cols < 2 * kRadius + kPixelLanes) {
    cv::FAST(image, corners, threshold, true);
    return corners;
  }
  CV_Assert(image.type() == CV_8UC1);
  const auto width = static_cast<std::size_t>(image.cols);
  std::vector<Pixel> scores(3 * width, 0);  // of three rows, in turns
  const auto of = [&](int row) { return scores.data() + static_cast<std::size_t>(row % 3) * width; };
  const int past = image.rows - kRadius;
  for (int row = kRadius; row <= past; ++row) {
    if (row < past) {
      Rows rows{};
      for (int r = 0; r < kRows; ++r) rows[static_cast<std::size_t>(r)] = image.ptr(row - kRadius + r);
      ScoreRow(rows, image.cols, static_cast<Pixel>(threshold), of(row));
    } else {
      std::fill_n(of(row), width, Pixel{0});
    }
    if (row > kRadius) AddStrongest(of(row - 2), of(row - 1), of(row), image.cols, row - 1, corners);
  }
  return corners;
}

}  // namespace fast

using fast::FastCorners;

}  // namespace tutti::internal
