#include "loopclosure/filter/alias_evidence.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>

#include "core/numbers.h"
#include "core/state_archive.h"

namespace tutti {
namespace {

constexpr double kFirstShare = 0.02;       // of the words: the level before anything is known
constexpr double kLongestMean = 80;        // images that the running mean stands for at most
constexpr std::size_t kTooFewPlaces = 20;  // in so few, the best wrong one says nothing yet
constexpr double kPlacePrior = 20;         // images that a place's own mean is held back by
constexpr double kLeastMean = 0.02;        // of a place's counts
constexpr double kMostAttraction = 3;      // a place's level lies within so many times the common one
constexpr double kLeastShare = 0.15;       // of the levels, however little an image repeats
constexpr double kLeastRepeated = 0.1;     // a member that repeats nothing may come to
constexpr double kLongestLasting = 40;     // images that the share of lasting aliases stands for at most
constexpr int kFollows = 2;                // slots from the image before's to the next one's alias

using internal::Index;

bool IsAmount(double value) { return value >= 0 && std::isfinite(value); }

// Largest count of the places, and of those that are not near, each with its slot (-1: no place has any).
struct Largest {
  double of_all = 0;
  double of_far = 0;
  int all_slot = -1;
  int far_slot = -1;
};

Largest LargestOf(const std::vector<double>& counts, const std::vector<int>& working_memory,
                  const std::vector<int>& near) {
  Largest largest;
  auto next_near = near.begin();
  for (const int slot : working_memory) {
    const double count = counts[Index(slot)];
    if (count > largest.of_all) {
      largest.of_all = count;
      largest.all_slot = slot;
    }
    while (next_near != near.end() && *next_near < slot) ++next_near;
    const bool far = next_near == near.end() || *next_near != slot;
    if (far && count > largest.of_far) {
      largest.of_far = count;
      largest.far_slot = slot;
    }
  }
  return largest;
}

}  // namespace

double AliasEvidence::Level() const { return std::exp(log_level_) - 1.0; }

double AliasEvidence::LevelOf(int slot) const {
  const double common = options_.alias_share * Level();
  const bool known = Index(slot) < seen_.size();
  const double mean = all_seen_ > 0 ? all_sum_ / all_seen_ : 0.0;
  const double sum = known ? sum_[Index(slot)] : 0.0;
  const double seen = known ? seen_[Index(slot)] : 0.0;
  const double own = (sum + kPlacePrior * mean) / (seen + kPlacePrior);
  const double attraction = (own + kLeastMean) / (mean + kLeastMean);
  return common *
         std::clamp(std::pow(attraction, options_.attraction), 1.0 / kMostAttraction, kMostAttraction);
}

Belief AliasEvidence::Likelihood(const std::vector<double>& counts, const std::vector<int>& working_memory,
                                 double words, double repeated, double overlap) {
  if (first_images_ < kFirstImages) {
    words_sum_ += words;
    ++first_images_;
    log_level_ = std::log1p(kFirstShare * words_sum_ / first_images_);
  }
  log_repeated_now_ = std::log(repeated + kLeastRepeated);
  const double share = repeated_images_ > 0 ? std::exp(log_repeated_now_ - log_repeated_) : 1.0;
  const double said_before = std::min(1.0, options_.persistence * lasting_) * std::clamp(overlap, 0.0, 1.0);
  return Weighed(counts, working_memory, std::clamp(share, kLeastShare, 1.0), 1.0 - said_before);
}

Belief AliasEvidence::Of(const std::vector<double>& counts, const std::vector<int>& working_memory) const {
  return Weighed(counts, working_memory, 1.0, 1.0);
}

Belief AliasEvidence::Weighed(const std::vector<double>& counts, const std::vector<int>& working_memory,
                              double share, double say) const {
  Belief likelihood;
  likelihood.places.assign(counts.size(), 0.0);
  const double sharpness = say * options_.sharpness;
  const double least = std::exp(options_.floor);
  // Most places share too little to reach the least, whatever their own level: they need no more arithmetic.
  const double lowest_level = share * options_.alias_share * Level() / kMostAttraction;
  const double enough =
      sharpness > 0.0 ? std::exp(options_.floor / sharpness) * (lowest_level + 1.0) - 1.0 : -1.0;
  for (const int slot : working_memory) {
    const double count = counts[Index(slot)];
    double& value = likelihood.places[Index(slot)];
    value = least;
    if (count <= 0.0 || count < enough) continue;
    value = std::max(least, std::pow((count + 1.0) / (share * LevelOf(slot) + 1.0), sharpness));
  }
  return likelihood;
}

void AliasEvidence::Learn(const std::vector<double>& counts, const std::vector<int>& working_memory,
                          const std::vector<int>& near, double new_place) {
  if (working_memory.size() <= kTooFewPlaces) return;
  const Largest largest = LargestOf(counts, working_memory, near);
  images_ = std::min(kLongestMean, images_ + 1.0);
  log_level_ += new_place * (std::log1p(largest.of_all) - log_level_) / images_;
  log_level_ += (1.0 - new_place) * (std::log1p(largest.of_far) - log_level_) / images_;
  LearnLasting(new_place > 0.5 ? largest.all_slot : largest.far_slot);
  if (new_place > 0.5) {
    repeated_images_ = std::min(kLongestMean, repeated_images_ + 1.0);
    log_repeated_ += (log_repeated_now_ - log_repeated_) / repeated_images_;
  }
  sum_.resize(counts.size(), 0.0);
  seen_.resize(counts.size(), 0.0);
  auto next_near = near.begin();
  for (const int slot : working_memory) {
    while (next_near != near.end() && *next_near < slot) ++next_near;
    const double share = next_near != near.end() && *next_near == slot ? new_place : 1.0;
    sum_[Index(slot)] += share * counts[Index(slot)];
    seen_[Index(slot)] += share;
    all_sum_ += share * counts[Index(slot)];
    all_seen_ += share;
  }
}

void AliasEvidence::LearnLasting(int alias) {
  const bool follows = alias >= 0 && last_alias_ >= 0 && std::abs(alias - last_alias_) <= kFollows;
  lasting_ += ((follows ? 1.0 : 0.0) - lasting_) / std::min(kLongestLasting, images_);
  last_alias_ = alias;
}

template <class Archive>
void AliasEvidence::StateOfLevel(Archive& archive) {
  archive(log_level_, words_sum_, first_images_, images_, log_repeated_, repeated_images_, lasting_,
          last_alias_);
  if constexpr (Archive::kReading) {
    const bool good = log_level_ >= 0 && log_level_ < 50 && IsAmount(words_sum_) && first_images_ >= 0 &&
                      first_images_ <= kFirstImages && images_ >= 1 && images_ <= kLongestMean &&
                      std::abs(log_repeated_) < 50 && repeated_images_ >= 0 &&
                      repeated_images_ <= kLongestMean && lasting_ >= 0 && lasting_ <= 1 && last_alias_ >= -1;
    if (!good) archive.Damaged("an alias level");
  }
}

template <class Archive>
void AliasEvidence::State(Archive& archive) {
  StateOfLevel(archive);
  archive(sum_, seen_, all_sum_, all_seen_);
  if constexpr (Archive::kReading) {
    if (sum_.size() != seen_.size() || !std::all_of(sum_.begin(), sum_.end(), IsAmount) ||
        !std::all_of(seen_.begin(), seen_.end(), IsAmount) || !IsAmount(all_sum_) || !IsAmount(all_seen_)) {
      archive.Damaged("counts of places");
    }
  }
}

void MemberWeight::Repeat(double count) {
  repeated_ += count;
  repeated_images_ += 1.0;
}

void MemberWeight::Learn(const std::vector<double>& counts, const std::vector<int>& working_memory,
                         const std::vector<int>& near) {
  if (working_memory.size() <= kTooFewPlaces) return;
  const double false_count = LargestOf(counts, working_memory, near).of_far;
  false_square_ += false_count * false_count;
  false_images_ += 1.0;
}

double MemberWeight::Value() const {
  const double repeated = repeated_images_ > 0 ? repeated_ / repeated_images_ : 0.0;
  const double noise = false_images_ > 0 ? false_square_ / false_images_ : 0.0;
  return (repeated + kLeastRepeated) / (noise + 1.0);
}

template <class Archive>
void MemberWeight::State(Archive& archive) {
  archive(repeated_, repeated_images_, false_square_, false_images_);
  if constexpr (Archive::kReading) {
    for (const double value : {repeated_, repeated_images_, false_square_, false_images_})
      if (!IsAmount(value)) archive.Damaged("a member's weight");
  }
}

void MemberOverlap::Learn(const std::vector<const std::vector<double>*>& counts,
                          const std::vector<int>& working_memory, const std::vector<int>& near) {
  if (working_memory.size() <= kTooFewPlaces + near.size()) return;
  if (covariance_.empty()) {
    members_ = counts.size();
    covariance_.assign(members_ * members_, 0.0);
  }
  std::vector<int> far;
  std::set_difference(working_memory.begin(), working_memory.end(), near.begin(), near.end(),
                      std::back_inserter(far));
  const double places = static_cast<double>(far.size());
  std::vector<std::vector<double>> apart(members_);  // from the mean of the places
  for (std::size_t k = 0; k < members_; ++k) {
    if (counts[k] == nullptr) continue;
    double mean = 0;
    for (const int slot : far) mean += (*counts[k])[Index(slot)] / places;
    for (const int slot : far) apart[k].push_back((*counts[k])[Index(slot)] - mean);
  }
  for (std::size_t a = 0; a < members_; ++a) {
    for (std::size_t b = 0; b <= a; ++b) {
      if (apart[a].empty() || apart[b].empty()) continue;
      covariance_[a * members_ + b] +=
          std::inner_product(apart[a].begin(), apart[a].end(), apart[b].begin(), 0.0) / places;
      covariance_[b * members_ + a] = covariance_[a * members_ + b];
    }
  }
}

double MemberOverlap::Correlation(std::size_t a, std::size_t b) const {
  if (a == b) return 1.0;
  const double scale = covariance_[a * members_ + a] * covariance_[b * members_ + b];
  return scale > 0 ? covariance_[a * members_ + b] / std::sqrt(scale) : 0.0;
}

double MemberOverlap::Copies(std::size_t member) const {
  constexpr double kPower = 8;
  if (members_ == 0) return 1.0;
  double copies = 0;
  for (std::size_t k = 0; k < members_; ++k) {
    copies += std::pow(std::clamp(Correlation(member, k), 0.0, 1.0), kPower);
  }
  return copies;
}

template <class Archive>
void MemberOverlap::State(Archive& archive) {
  archive(covariance_);
  if constexpr (Archive::kReading) {
    members_ = 0;
    while (members_ * members_ < covariance_.size()) ++members_;
    if (members_ * members_ != covariance_.size() ||
        !std::all_of(covariance_.begin(), covariance_.end(), [](double v) { return std::isfinite(v); }))
      archive.Damaged("what members have in common");
  }
}

template void AliasEvidence::StateOfLevel(internal::StateWriter& archive);
template void AliasEvidence::StateOfLevel(internal::StateReader& archive);
template void AliasEvidence::State(internal::StateWriter& archive);
template void AliasEvidence::State(internal::StateReader& archive);
template void MemberWeight::State(internal::StateWriter& archive);
template void MemberWeight::State(internal::StateReader& archive);
template void MemberOverlap::State(internal::StateWriter& archive);
template void MemberOverlap::State(internal::StateReader& archive);

}  // namespace tutti
