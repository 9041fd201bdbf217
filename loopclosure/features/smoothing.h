// Gaussian blur of float images, and what the members see of an image that is more noise than contrast.
// Internal.
//
// cv::GaussianBlur fuses multiplications with additions where the processor can, so that SIFT's features, and
// with them every loop, had other last bits on processors with AVX2 and FMA than on those without.
#pragma once

#include <opencv2/core.hpp>

namespace tutti::internal {

/// `from` (CV_32FC1) blurred with `sigma` [px] into `to`, another image: the kernel ends after 3 sigma, the
/// image is mirrored at its border pixels (cv::BORDER_REFLECT_101). The same bits on every processor.
void GaussianBlur(const cv::Mat& from, double sigma, cv::Mat& to);

/// Noise of an 8-bit grey image and the range of its values, of a sample of its lines.
struct ImageContrast {
  double noise = 0;  ///< standard deviation [grey levels]: Immerkaer's mask (CVIU 1996), by the median
  int low = 0;       ///< below it lies a hundredth of the pixels
  int high = 0;      ///< above it lies a hundredth

  /// Noise as a share of the range: 0.02 in daylight, 0.1 at dusk.
  double NoiseShare() const { return noise / (high > low ? high - low : 1); }
};
ImageContrast ContrastOf(const cv::Mat& grey);

/// An 8-bit grey image as its features are to be taken from it: of a noisy one (NoiseShare), noise is taken
/// out where nothing else is (Wiener's filter), and grey values are stretched; any other is returned as it
/// is, sharing its memory.
cv::Mat Cleared(const cv::Mat& grey);

}  // namespace tutti::internal
