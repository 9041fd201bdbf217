#include "alias_evidence.h"

#include <algorithm>
#include <cmath>

#include "byte_stream.h"

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

std::size_t Index(int slot) { return static_cast<std::size_t>(slot); }

// Largest count of the places, and of those that are not near.
struct Largest {
  double of_all = 0;
  double of_far = 0;
};

Largest LargestOf(const std::vector<double>& counts, const std::vector<int>& working_memory,
                  const std::vector<int>& near) {
  Largest largest;
  auto next_near = near.begin();
  for (const int slot : working_memory) {
    const double count = counts[Index(slot)];
    largest.of_all = std::max(largest.of_all, count);
    while (next_near != near.end() && *next_near < slot) ++next_near;
    if (next_near == near.end() || *next_near != slot) largest.of_far = std::max(largest.of_far, count);
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
                                 double words, double repeated) {
  if (first_images_ < kFirstImages) {
    words_sum_ += words;
    ++first_images_;
    log_level_ = std::log1p(kFirstShare * words_sum_ / first_images_);
  }
  log_repeated_now_ = std::log(repeated + kLeastRepeated);
  const double share = repeated_images_ > 0 ? std::exp(log_repeated_now_ - log_repeated_) : 1.0;
  return Of(counts, working_memory, std::clamp(share, kLeastShare, 1.0));
}

Belief AliasEvidence::Of(const std::vector<double>& counts, const std::vector<int>& working_memory,
                         double share) const {
  Belief likelihood;
  likelihood.places.assign(counts.size(), 0.0);
  const double least = std::exp(options_.floor);
  // Most places share too little to reach the least, whatever their own level: they need no more arithmetic.
  const double lowest_level = share * options_.alias_share * Level() / kMostAttraction;
  const double enough = std::exp(options_.floor / options_.sharpness) * (lowest_level + 1.0) - 1.0;
  for (const int slot : working_memory) {
    const double count = counts[Index(slot)];
    double& value = likelihood.places[Index(slot)];
    value = least;
    if (count <= 0.0 || count < enough) continue;
    value = std::max(least, std::pow((count + 1.0) / (share * LevelOf(slot) + 1.0), options_.sharpness));
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

void AliasEvidence::SaveLevel(internal::ByteWriter& out) const {
  out.Put(log_level_);
  out.Put(words_sum_);
  out.Put<std::int32_t>(first_images_);
  out.Put(images_);
  out.Put(log_repeated_);
  out.Put(repeated_images_);
}

void AliasEvidence::LoadLevel(internal::ByteReader& in) {
  log_level_ = in.Get<double>();
  words_sum_ = in.Get<double>();
  first_images_ = in.Get<std::int32_t>();
  images_ = in.Get<double>();
  log_repeated_ = in.Get<double>();
  repeated_images_ = in.Get<double>();
  const bool good = log_level_ >= 0 && log_level_ < 50 && words_sum_ >= 0 && std::isfinite(words_sum_) &&
                    first_images_ >= 0 && first_images_ <= kFirstImages && images_ >= 1 &&
                    images_ <= kLongestMean && std::abs(log_repeated_) < 50 && repeated_images_ >= 0 &&
                    repeated_images_ <= kLongestMean;
  if (!good) in.Damaged("an alias level");
}

void AliasEvidence::Save(internal::ByteWriter& out) const {
  SaveLevel(out);
  out.PutVector(sum_);
  out.PutVector(seen_);
  out.Put(all_sum_);
  out.Put(all_seen_);
}

void AliasEvidence::Load(internal::ByteReader& in) {
  LoadLevel(in);
  sum_ = in.GetVector<double>();
  seen_ = in.GetVector<double>();
  all_sum_ = in.Get<double>();
  all_seen_ = in.Get<double>();
  const auto good = [](double value) { return value >= 0 && std::isfinite(value); };
  if (sum_.size() != seen_.size() || !std::all_of(sum_.begin(), sum_.end(), good) ||
      !std::all_of(seen_.begin(), seen_.end(), good) || !good(all_sum_) || !good(all_seen_)) {
    in.Damaged("counts of places");
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

void MemberWeight::Save(internal::ByteWriter& out) const {
  for (const double value : {repeated_, repeated_images_, false_square_, false_images_}) out.Put(value);
}

void MemberWeight::Load(internal::ByteReader& in) {
  for (double* value : {&repeated_, &repeated_images_, &false_square_, &false_images_}) {
    *value = in.Get<double>();
    if (!(*value >= 0) || !std::isfinite(*value)) in.Damaged("a member's weight");
  }
}

}  // namespace tutti
