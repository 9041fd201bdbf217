// One member's incremental visual vocabulary: descriptors in, word ids out.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "tutti/loopclosure/descriptor_index.h"
#include "tutti/loopclosure/detector_options.h"

namespace tutti {

/// Incremental vocabulary, no training and no file (loop-closure.md section 3; Labbe & Michaud 2013, section
/// III-A).
///
/// A descriptor becomes a new word if it has fewer than two neighbours or d1 > nndr * d2, on true distance,
/// where the neighbours come from the index and, exactly, from the words that this same image has just
/// created. The index grows by insertion after each image.
class Vocabulary {
 public:
  Vocabulary(const VocabularyOptions& options, std::uint64_t seed) : options_(options), seed_(seed) {}

  /// Words of N descriptors (CV_32F: Euclidean, CV_8U: Hamming), one per row, in row order; new ones are
  /// added. The search runs on up to `threads` threads, with the same result for any number. Throws
  /// InputError for another type or width than before.
  std::vector<int> Quantise(const cv::Mat& descriptors, int threads = 1);

  /// Number of words. Word ids are 0 .. size() - 1.
  int size() const { return index_ ? index_->size() : 0; }

 private:
  void CheckType(const cv::Mat& descriptors);

  VocabularyOptions options_;
  std::uint64_t seed_;
  int type_ = -1;
  int width_ = 0;
  std::unique_ptr<DescriptorIndex> index_;
};

}  // namespace tutti
