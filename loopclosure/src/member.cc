#include "tutti/loopclosure/member.h"

namespace tutti {

Member::Member(const std::string& name, const LoopDetectorOptions& options, std::uint64_t seed)
    : name_(name),
      bad_signature_ratio_(options.bad_signature_ratio),
      extractor_(name, options.extraction),
      vocabulary_(options.vocabulary, seed) {}

Signature Member::Quantise(const Features& features) {
  const double count = static_cast<double>(features.keypoints.size());
  feature_sum_ += count;
  ++images_;
  const double mean = feature_sum_ / images_;
  if (count < 2 || count < bad_signature_ratio_ * mean) return {};
  return Signature(vocabulary_.Quantise(features.descriptors));
}

}  // namespace tutti
