// SIFT that describes only the points that are kept. Internal.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <mutex>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "tutti/loopclosure/features.h"

namespace tutti::internal {

/// Memory of one extraction, to be used again: fresh pages cost more than the work that fills them.
struct SiftScratch {
  static constexpr int kBlurs = 6;             ///< images of an octave
  using Octave = std::array<cv::Mat, kBlurs>;  ///< each more blurred than the one before, CV_32F
  std::vector<Octave> pyramid;                 ///< octaves, each of half the size
  cv::Mat values;                              ///< the image as CV_32F
  cv::Mat lines;                               ///< of differences between images of an octave
  std::vector<std::uint8_t> found;             ///< of one line
};

/// Scratches that are not in use. Safe from several threads at once.
class SiftScratchPool {
 public:
  /// One that nobody else uses until it is given back.
  std::unique_ptr<SiftScratch> Take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (free_.empty()) return std::make_unique<SiftScratch>();
    std::unique_ptr<SiftScratch> scratch = std::move(free_.back());
    free_.pop_back();
    return scratch;
  }
  /// Gives it back.
  void Give(std::unique_ptr<SiftScratch> scratch) {
    const std::lock_guard<std::mutex> lock(mutex_);
    free_.push_back(std::move(scratch));
  }

 private:
  std::mutex mutex_;
  std::vector<std::unique_ptr<SiftScratch>> free_;
};

/// SIFT of an 8-bit grey image (Lowe 2004, with the constants of cv::SIFT), its first octave the image as it
/// is: at most options.features, keypoints in pixels of this image, descriptors 128 whole numbers as CV_32F.
/// What cv::SIFT does with every point that it finds, orientation and description, is done for the points
/// that SelectSpread keeps. `blur`: standard deviation of what the image is already smoothed by [px].
Features ExtractSift(const cv::Mat& image, double blur, const ExtractionOptions& options,
                     SiftScratch& scratch);

}  // namespace tutti::internal
