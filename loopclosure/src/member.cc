#include "tutti/loopclosure/member.h"

#include <algorithm>
#include <cmath>

#include "byte_stream.h"

namespace tutti {

Member::Member(const std::string& name, const LoopDetectorOptions& options, std::uint64_t seed)
    : name_(name), bad_signature_ratio_(options.bad_signature_ratio), vocabulary_(options.vocabulary, seed) {
  const std::vector<std::string>& external = options.external_members;
  if (std::find(external.begin(), external.end(), name) == external.end()) {
    extractor_.emplace(name, options.extraction);
  }
}

bool Member::Judge(const Features& features) {
  const double count = static_cast<double>(features.keypoints.size());
  feature_sum_ += count;
  ++images_;
  const double mean = feature_sum_ / images_;
  return count >= 2 && count >= bad_signature_ratio_ * mean;
}

void Member::SaveStatistics(internal::ByteWriter& out) const {
  out.Put(feature_sum_);
  out.Put<std::int32_t>(images_);
  out.Put<std::int32_t>(vocabulary_.created());
}

void Member::LoadStatistics(internal::ByteReader& in) {
  feature_sum_ = in.Get<double>();
  images_ = in.Get<std::int32_t>();
  const int created = in.Get<std::int32_t>();
  constexpr int kMostImages = 1 << 30;
  if (!(feature_sum_ >= 0) || !std::isfinite(feature_sum_) || images_ < 0 || images_ > kMostImages ||
      created < 0 || created > Vocabulary::kMostWords) {
    in.Damaged("a member's statistics");
  }
  vocabulary_.SkipIds(created);
}

}  // namespace tutti
