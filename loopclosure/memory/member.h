// One member of the ensemble: its features, its vocabulary, and what it takes for a bad signature.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "loopclosure/vocabulary/vocabulary.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/loopclosure/features.h"

namespace tutti {

class DnnDescriptor;

/// Extracts, and quantises or (a dense member) compares as a whole, for one kind of features (loop-closure.md
/// section 1, steps 1 and 2).
class Member {
 public:
  /// `name`: of options.members; `seed`: of its vocabulary's index. Throws InputError for
  /// another name, and for a network of the member dnn that can't be used (whole_image.h).
  Member(const std::string& name, const LoopDetectorOptions& options, std::uint64_t seed);

  const std::string& name() const { return name_; }

  /// Step 1: features of an image: `grey` is what ToGrey8 makes of it. Where `mask` (CV_8UC1, or empty) is 0
  /// nothing counts for a dense member; the features of others are for the caller to drop. Safe to call for
  /// several members at once. None for an external member. Throws InputError for a network that does not
  /// give finite numbers, never for an image.
  Features Extract(const cv::Mat& image, const cv::Mat& grey, const cv::Mat& mask) const;
  /// True if the caller extracts this member's features.
  bool external() const { return external_; }
  /// True if it describes images as a whole (dense_model.h): no keypoints, one row of descriptors, no words.
  bool dense() const { return dense_; }
  /// Width of a dense member's descriptors [values], 0: not known yet.
  int width() const { return width_; }

  /// What its descriptors depend on beyond its name, in words; empty if nothing.
  std::string Fingerprint() const;

  /// Step 2: false for a bad signature (of a dense member: no descriptor; of others: fewer features than
  /// bad_signature_ratio x their running mean, or fewer than two), which gets no words: the member sits this
  /// image out. Once per image: keeps the mean.
  bool Judge(const Features& features);
  /// Words of its vocabulary; 0 for a dense member.
  int num_words() const { return vocabulary_.size(); }
  /// Its vocabulary, for the memory: words leave and return with locations.
  Vocabulary& vocabulary() { return vocabulary_; }
  /// Its vocabulary.
  const Vocabulary& vocabulary() const { return vocabulary_; }

  /// Its running figures: all but the vocabulary, which only learns which ids are taken.
  template <class Archive>
  void State(Archive& archive);

 private:
  std::string name_;
  double bad_signature_ratio_;
  bool external_ = false;
  bool dense_ = false;
  int width_ = 0;
  std::optional<FeatureExtractor> extractor_;
  std::shared_ptr<const DnnDescriptor> network_;
  Vocabulary vocabulary_;
  double feature_sum_ = 0.0;
  int images_ = 0;
};

}  // namespace tutti
