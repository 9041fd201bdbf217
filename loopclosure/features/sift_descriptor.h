// Orientations and descriptors of SIFT's points. Internal.
#pragma once

#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

namespace tutti::internal {

constexpr std::size_t kSiftValues = 128;  ///< of a descriptor

/// Directions of the gradient that stand out around a point of an octave's image (CV_32F) [deg,
/// counter-clockwise]. `at` and `scale` in its pixels.
std::vector<float> SiftOrientations(const cv::Mat& image, const cv::Point2f& at, float scale);

/// The 128 values of a point's descriptor, whole numbers; `angle_deg` as cv::KeyPoint has it.
void DescribeSift(const cv::Mat& image, const cv::Point2f& at, float scale, float angle_deg,
                  float* descriptor);

}  // namespace tutti::internal
