// SIFT that describes only the points that are kept. Internal.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "loopclosure/features/scratch_pool.h"
#include "tutti/loopclosure/features.h"

namespace tutti::internal {

constexpr std::size_t kSiftValues = 128;  ///< of a descriptor

/// Directions of the gradient that stand out around a point of an octave's image (CV_32F) [deg,
/// counter-clockwise]. `at` and `scale` in its pixels.
std::vector<float> SiftOrientations(const cv::Mat& image, const cv::Point2f& at, float scale);

/// The 128 values of a point's descriptor, whole numbers; `angle_deg` as cv::KeyPoint has it.
void DescribeSift(const cv::Mat& image, const cv::Point2f& at, float scale, float angle_deg,
                  float* descriptor);

/// Memory of one extraction, to be used again: fresh pages cost more than the work that fills them.
struct SiftScratch {
  static constexpr int kBlurs = 6;             ///< images of an octave
  using Octave = std::array<cv::Mat, kBlurs>;  ///< each more blurred than the one before, CV_32F
  std::vector<Octave> pyramid;                 ///< octaves, each of half the size
  cv::Mat values;                              ///< the image as CV_32F
  cv::Mat lines;                               ///< of differences between images of an octave
  std::vector<std::uint8_t> found;             ///< of one line
};

/// Declared in a public header.
class SiftScratchPool : public ScratchPool<SiftScratch> {};

/// Contrasts as shares of white; cv::SIFT's own threshold is 0.04.
struct SiftOptions {
  int features = 400;             ///< at most
  double contrast = 0.02;         ///< points of this contrast are taken as they are
  double least_contrast = 0.003;  ///< weaker ones fill up, in order of strength, down to this: a blank
                                  ///< image's noise stays below it
};

/// SIFT of an 8-bit grey image (Lowe 2004, with the constants of cv::SIFT), its first octave the image as it
/// is: at most options.features, keypoints in pixels of this image, descriptors 128 whole numbers as CV_32F.
/// What cv::SIFT does with every point that it finds, orientation and description, is done for the points
/// that SelectSpread keeps. `blur`: standard deviation of what the image is already smoothed by [px].
Features ExtractSift(const cv::Mat& image, double blur, const SiftOptions& options, SiftScratch& scratch);

}  // namespace tutti::internal
