// FAST corners of one level of a pyramid, spread over it by a grid.
//
// E. Rosten, T. Drummond, "Machine learning for high-speed corner detection", ECCV 2006 (OpenCV's).
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace tutti {

/// Two thresholds, and how many corners to keep.
struct CornerOptions {
  int wanted = 0;
  int threshold = 0;      ///< of corners, where there are any
  int threshold_min = 0;  ///< in cells of the grid that have none; at most `threshold`
  int border = 0;         ///< [px] no corner lies nearer to the image's rim; at least 3
};

/// Corners of an 8-bit grey image at whole pixels, with FAST's score as response. If there are more than
/// wanted, then round by round the strongest that is left in each cell, and in the order of their strength;
/// corners below the upper threshold count only where a cell has nothing better, so that weak texture is
/// covered without crowding out strong corners. An image that is smaller than its borders has none, and
/// neither has a place where `mask` (CV_8UC1, as large as the image; empty: nowhere) is 0.
std::vector<cv::KeyPoint> DetectCorners(const cv::Mat& image, const CornerOptions& options,
                                        const cv::Mat& mask = {});

}  // namespace tutti
