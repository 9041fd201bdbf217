// One member of the ensemble: its features, its vocabulary, and what it takes for a bad signature.
#pragma once

#include <optional>
#include <string>

#include "tutti/loopclosure/detector_options.h"
#include "tutti/loopclosure/features.h"
#include "tutti/loopclosure/vocabulary.h"

namespace tutti {

/// Extracts and quantises for one kind of features (loop-closure.md section 1, steps 1 and 2).
class Member {
 public:
  /// `name`: surf, sift, orb, akaze or brisk; `seed`: of its vocabulary's index. Throws InputError for
  /// another name.
  Member(const std::string& name, const LoopDetectorOptions& options, std::uint64_t seed);

  /// As given.
  const std::string& name() const { return name_; }

  /// Step 1: features of an 8-bit grey image. Safe to call for several members at once. None for an external
  /// member.
  Features Extract(const cv::Mat& grey) const { return extractor_ ? extractor_->Extract(grey) : Features(); }
  /// True if the caller extracts this member's features.
  bool external() const { return !extractor_; }

  /// Step 2: false for a bad signature (fewer features than bad_signature_ratio x their running mean, or
  /// fewer than two), which gets no words: the member sits this image out. Once per image: keeps the mean.
  bool Judge(const Features& features);
  int num_words() const { return vocabulary_.size(); }
  /// Its vocabulary, for the memory: words leave and return with locations.
  Vocabulary& vocabulary() { return vocabulary_; }
  /// Its vocabulary.
  const Vocabulary& vocabulary() const { return vocabulary_; }

  /// Appends its running figures: all of the state but the vocabulary.
  void SaveStatistics(internal::ByteWriter& out) const;
  /// Takes up what SaveStatistics wrote. Throws InputError if it is damaged.
  void LoadStatistics(internal::ByteReader& in);

 private:
  std::string name_;
  double bad_signature_ratio_;
  std::optional<FeatureExtractor> extractor_;
  Vocabulary vocabulary_;
  double feature_sum_ = 0.0;
  int images_ = 0;
};

}  // namespace tutti
