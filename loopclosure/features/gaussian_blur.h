// Gaussian blur of float images. Internal.
//
// cv::GaussianBlur fuses multiplications with additions where the processor can, so that SIFT's features, and
// with them every loop, had other last bits on processors with AVX2 and FMA than on those without.
#pragma once

#include <opencv2/core.hpp>

namespace tutti::internal {

/// `from` (CV_32FC1) blurred with `sigma` [px] into `to`, another image: the kernel ends after 3 sigma, the
/// image is mirrored at its border pixels (cv::BORDER_REFLECT_101). The same bits on every processor.
void GaussianBlur(const cv::Mat& from, double sigma, cv::Mat& to);

}  // namespace tutti::internal
