#include "loopclosure/filter/alias_evidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <random>
#include <utility>

#include "core/state_archive.h"
#include "loopclosure/filter/bayes_filter.h"
#include "tests/loopclosure/filter/image_counts.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::Places;
using testing::Resemblances;

// After many images of a new place.
AliasEvidence Experienced(int n, double most) {
  AliasEvidence evidence{EvidenceOptions()};
  std::mt19937 random(1);
  for (int i = 0; i < 300; ++i) {
    const std::vector<double> counts = Resemblances(n, most, random);
    evidence.Likelihood(counts, Places(n), 1200, 20, 0);
    evidence.Learn(counts, Places(n), {}, 1.0);
  }
  return evidence;
}

TEST(AliasEvidence, NoWordInCommonSaysNewPlaceHoweverManyPlacesThereAre) {
  for (const int n : {1, 10, 100, 2000}) {
    LocationMemory memory(1);
    TransitionModel transition;
    for (int i = 0; i <= n; ++i) memory.Add(i);
    transition.Update(memory, memory.Settle());
    AliasEvidence evidence{EvidenceOptions()};
    BayesFilter filter;
    const std::vector<double> nothing(static_cast<std::size_t>(memory.size()), 0.0);
    for (int image = 0; image < 30; ++image) {
      filter.Step(transition, memory.working_memory(),
                  evidence.Likelihood(nothing, memory.working_memory(), 0, 0, 0));
    }
    EXPECT_LT(filter.posterior().Hypothesis(), LoopDetectorOptions().propose_threshold) << n << " places";
  }
}

TEST(AliasEvidence, CountsBeyondTheLevelSpeakForAPlaceAndFewSpeakAgainstIt) {
  AliasEvidence evidence = Experienced(100, 5.0);
  std::vector<double> counts(100, 1.0);
  counts[7] = 40.0;
  const Belief likelihood = evidence.Of(counts, Places(100));
  EXPECT_EQ(likelihood.new_place, 1.0);
  const EvidenceOptions options;
  EXPECT_NEAR(likelihood.places[7], std::pow(41.0 / (evidence.LevelOf(7) + 1.0), options.sharpness), 1e-9);
  EXPECT_GT(likelihood.places[7], 30.0);
  EXPECT_NEAR(likelihood.places[8], std::exp(options.floor), 1e-12);
}

// After many images of a new place in which the best wrong place lasts for so many images in a row.
AliasEvidence AfterAliasesThatLast(int images) {
  AliasEvidence evidence{EvidenceOptions()};
  std::mt19937 random(4);
  std::uniform_int_distribution<int> anywhere(0, 80);
  int alias = 0;
  for (int i = 0; i < 300; ++i) {
    alias = i % images == 0 ? anywhere(random) : alias + 1;
    std::vector<double> counts = Resemblances(100, 4.0, random);
    counts[static_cast<std::size_t>(alias)] = 6.0;
    evidence.Likelihood(counts, Places(100), 1200, 20, 0.7);
    evidence.Learn(counts, Places(100), {}, 1.0);
  }
  return evidence;
}

TEST(AliasEvidence, WhereWrongPlacesLastSuccessiveImagesSayOnlyWhatIsNewInThem) {
  std::vector<double> counts(100, 0.0);
  counts[7] = 40.0;
  AliasEvidence lasting = AfterAliasesThatLast(10);
  const Belief by_itself = lasting.Likelihood(counts, Places(100), 1200, 20, 0.0);
  const Belief half_new = lasting.Likelihood(counts, Places(100), 1200, 20, 0.5);
  EXPECT_NEAR(std::log(half_new.places[7]), 0.5 * std::log(by_itself.places[7]), 1e-9);
  EXPECT_EQ(lasting.Likelihood(counts, Places(100), 1200, 20, 1.0).places[7], 1.0);
  // What speaks against a place is not weakened: it would be taken for a revisit.
  EXPECT_EQ(half_new.places[8], by_itself.places[8]);
  EXPECT_LT(half_new.places[8], 1.0);
  // Where no wrong place lasts, successive images are believed nearly as any.
  AliasEvidence passing = AfterAliasesThatLast(1);
  const double apart = passing.Likelihood(counts, Places(100), 1200, 20, 0.0).places[7];
  EXPECT_GT(std::log(passing.Likelihood(counts, Places(100), 1200, 20, 0.5).places[7]),
            0.75 * std::log(apart));
}

TEST(AliasEvidence, GoesOnWhereItWasSavedAndRefusesDamage) {
  AliasEvidence evidence = Experienced(50, 5.0);
  const std::string bytes = internal::StateBytes(evidence);
  AliasEvidence loaded{EvidenceOptions()};
  internal::ReadStateBytes(bytes, "memory", loaded);
  EXPECT_EQ(loaded.Level(), evidence.Level());
  for (int slot = 0; slot < 50; ++slot) EXPECT_EQ(loaded.LevelOf(slot), evidence.LevelOf(slot));
  EXPECT_EQ(loaded.Lasting(), evidence.Lasting());
  // Level, sum of words, first images (4 bytes), images, what images repeat, of how many, what lasts.
  for (const std::size_t at : {0, 8, 20, 28, 36, 44}) {
    std::string damaged = bytes;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::memcpy(damaged.data() + at, &nan, sizeof nan);
    AliasEvidence refuses{EvidenceOptions()};
    EXPECT_THROW(internal::ReadStateBytes(damaged, "memory", refuses), InputError) << "at byte " << at;
  }
}

// An image as the filter sees it, at random.
struct SeenImage {
  explicit SeenImage(std::mt19937& random) : counts(Resemblances(30, 9.0, random)) {
    const auto between = [&random](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(random);
    };
    words = between(100, 900);
    repeated = between(0, 30);
    overlap = between(-0.2, 1.2);
    new_place = between(0, 1);
    const int first = static_cast<int>(between(0, 26));
    for (int slot = first; slot < first + 4; ++slot) near.push_back(slot);
  }
  bool IsNear(std::size_t slot) const {
    return std::count(near.begin(), near.end(), static_cast<int>(slot)) != 0;
  }

  std::vector<double> counts;
  std::vector<int> near;
  double words, repeated, overlap, new_place;
};

// The means that the evidence keeps, one image after the other: what it says is computed from them at once.
class AliasMeans {
 public:
  void See(const SeenImage& image) {
    if (++images_ <= AliasEvidence::kFirstImages) {
      words_ += image.words;
      log_level_ = std::log1p(0.02 * words_ / images_);
    }
    log_repeated_ = std::log(image.repeated + 0.1);
  }

  double Level() const { return std::expm1(log_level_); }
  double LevelOf(std::size_t slot) const {
    const double own = (sums_[slot] + 20 * Mean()) / (seen_[slot] + 20);
    const double attraction = std::pow((own + 0.02) / (Mean() + 0.02), options_.attraction);
    return options_.alias_share * Level() * std::min(3.0, std::max(1.0 / 3, attraction));
  }
  double Lasting() const { return lasting_; }

  double Likelihood(const SeenImage& image, std::size_t slot) const {
    const double repeats = repeated_images_ == 0 ? 1 : std::exp(log_repeated_ - log_usual_);
    const double level = LevelOf(slot) * std::min(1.0, std::max(0.15, repeats));
    const double said =
        std::min(1.0, options_.persistence * lasting_) * std::min(1.0, std::max(0.0, image.overlap));
    const double speaks = (1 - said) * options_.sharpness * std::log((image.counts[slot] + 1) / (level + 1));
    return std::exp(std::max(options_.floor, speaks));
  }

  void Learn(const SeenImage& image) {
    double best = 0, best_far = 0;
    int alias = -1, far_alias = -1;
    for (std::size_t slot = 0; slot < 30; ++slot) {
      const double count = image.counts[slot];
      if (count > best) best = count, alias = static_cast<int>(slot);
      if (count > best_far && !image.IsNear(slot)) best_far = count, far_alias = static_cast<int>(slot);
    }
    stands_for_ = std::min(80.0, stands_for_ + 1);
    for (const auto& [share, count] :
         {std::pair(image.new_place, best), std::pair(1 - image.new_place, best_far)})
      log_level_ += share * (std::log1p(count) - log_level_) / stands_for_;
    const bool is_new = image.new_place > 0.5;
    const int now = is_new ? alias : far_alias;
    const bool follows = last_ >= 0 && std::abs(now - last_) <= 2;
    lasting_ += ((follows ? 1 : 0) - lasting_) / std::min(40.0, stands_for_);
    last_ = now;
    if (is_new) {
      repeated_images_ = std::min(80, repeated_images_ + 1);
      log_usual_ += (log_repeated_ - log_usual_) / repeated_images_;
    }
    for (std::size_t slot = 0; slot < 30; ++slot) {
      const double share = image.IsNear(slot) ? image.new_place : 1;
      sums_[slot] += share * image.counts[slot];
      seen_[slot] += share;
    }
  }

 private:
  double Mean() const {
    const double seen = std::accumulate(seen_.begin(), seen_.end(), 0.0);
    return seen > 0 ? std::accumulate(sums_.begin(), sums_.end(), 0.0) / seen : 0;
  }

  EvidenceOptions options_;
  int images_ = 0, repeated_images_ = 0, last_ = -1;
  double words_ = 0, log_level_ = 0, stands_for_ = 15, log_repeated_ = 0, log_usual_ = 0, lasting_ = 0;
  std::vector<double> sums_ = std::vector<double>(30, 0.0), seen_ = sums_;
};

TEST(AliasEvidence, FollowsTheMeansOfAllImagesBefore) {
  AliasEvidence evidence{EvidenceOptions()};
  AliasMeans means;
  std::mt19937 random(6);
  for (int i = 0; i < 130; ++i) {
    const SeenImage image(random);
    means.See(image);
    const Belief said =
        evidence.Likelihood(image.counts, Places(30), image.words, image.repeated, image.overlap);
    for (std::size_t slot = 0; slot < 30; ++slot) {
      const double expected = means.Likelihood(image, slot);
      ASSERT_NEAR(said.places[slot], expected, 1e-9 * expected) << "image " << i << ", slot " << slot;
    }
    evidence.Learn(image.counts, Places(30), image.near, image.new_place);
    means.Learn(image);
    ASSERT_NEAR(evidence.Level(), means.Level(), 1e-9) << i;
    ASSERT_NEAR(evidence.Lasting(), means.Lasting(), 1e-12) << i;
    for (std::size_t slot = 0; slot < 30; ++slot)
      ASSERT_NEAR(evidence.LevelOf(static_cast<int>(slot)), means.LevelOf(slot), 1e-9) << i;
  }
}

TEST(AliasEvidence, LearnsFromMoreThanTwentyPlacesAlone) {
  for (const int places : {20, 21}) {
    AliasEvidence evidence{EvidenceOptions()};
    const std::vector<double> counts(static_cast<std::size_t>(places), 3.0);
    evidence.Likelihood(counts, Places(places), 1000, 20, 0);
    evidence.Learn(counts, Places(places), {}, 1.0);
    EXPECT_EQ(evidence.Level() < 19.9, places == 21) << places;
  }
}

}  // namespace
}  // namespace tutti
