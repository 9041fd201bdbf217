#include "loopclosure/memory/member.h"

#include <algorithm>
#include <cmath>

#include "core/state_archive.h"
#include "loopclosure/features/whole_image.h"

namespace tutti {

Member::Member(const std::string& name, const LoopDetectorOptions& options, std::uint64_t seed)
    : name_(name), bad_signature_ratio_(options.bad_signature_ratio), vocabulary_(options.vocabulary, seed) {
  const auto holds = [&name](const std::vector<std::string>& names) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  external_ = holds(options.external_members);
  dense_ = external_ ? holds(options.dense_members) : holds(KnownDenseMembers());
  if (!external_ && !dense_) extractor_.emplace(name, options.extraction);
  if (!external_ && name == "dnn") {
    network_ = std::make_shared<const DnnDescriptor>(options.dnn);
    width_ = network_->width();
  }
}

Features Member::Extract(const cv::Mat& image, const cv::Mat& grey, const cv::Mat& mask) const {
  if (external_) return {};
  if (extractor_) return extractor_->Extract(grey);
  if (network_) return {{}, network_->Describe(image, grey, mask)};
  return {{}, DescribeByGradients(grey, mask)};
}

std::string Member::Fingerprint() const {
  if (network_) return network_->Fingerprint();
  return external_ && dense_ ? "dense" : "";
}

bool Member::Judge(const Features& features) {
  if (dense_) {
    if (features.descriptors.empty()) return false;
    width_ = features.descriptors.cols;
    return !NormalisedDescriptor(features.descriptors).empty();
  }
  const double count = static_cast<double>(features.keypoints.size());
  feature_sum_ += count;
  ++images_;
  const double mean = feature_sum_ / images_;
  return count >= 2 && count >= bad_signature_ratio_ * mean;
}

template <class Archive>
void Member::State(Archive& archive) {
  int created = vocabulary_.created();
  archive(feature_sum_, images_);
  if (dense_) archive(width_);
  archive(created);
  if constexpr (Archive::kReading) {
    if (network_ && width_ != network_->width())
      archive.Damaged("descriptors of another length than the network's");
    constexpr int kMostImages = 1 << 30;
    if (width_ < 0 || !(feature_sum_ >= 0) || !std::isfinite(feature_sum_) || images_ < 0 ||
        images_ > kMostImages || created < 0 || created > Vocabulary::kMostWords) {
      archive.Damaged("a member's statistics");
    }
    vocabulary_.SkipIds(created);
  }
}

template void Member::State(internal::StateWriter& archive);
template void Member::State(internal::StateReader& archive);

}  // namespace tutti
