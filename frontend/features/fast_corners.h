// FAST: corners that nine neighbouring pixels of a circle around them are all brighter, or all darker, than.
// E. Rosten, T. Drummond, "Machine learning for high-speed corner detection", ECCV 2006.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace tutti {

/// What cv::FAST(image, corners, threshold, true) finds in an 8-bit grey image (16 pixels around, 9 in a row,
/// those next to a stronger one left out), in the same order: by row, then by column; none above 255. In a
/// fraction of its time: scores are computed for many corners at once.
std::vector<cv::KeyPoint> FastCorners(const cv::Mat& image, int threshold);

}  // namespace tutti
