#include "loopclosure/filter/alias_evidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>
#include <random>

#include "core/byte_stream.h"
#include "loopclosure/filter/bayes_filter.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

std::vector<int> Places(int n) {
  std::vector<int> places(static_cast<std::size_t>(n));
  std::iota(places.begin(), places.end(), 0);
  return places;
}

// Counts of images that show nothing known: at most `most`.
std::vector<double> Resemblances(int n, double most, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(0.0, most);
  std::vector<double> counts(static_cast<std::size_t>(n));
  for (double& count : counts) count = uniform(random);
  return counts;
}

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
    TransitionModel transition(0.9);
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

TEST(AliasEvidence, TheLevelIsWhatTheBestWrongPlaceReaches) {
  const AliasEvidence evidence = Experienced(100, 7.0);
  EXPECT_GT(evidence.Level(), 6.5);
  EXPECT_LT(evidence.Level(), 7.2);
}

TEST(AliasEvidence, BeforeAnythingIsKnownTheLevelIsHighAndFallsWithExperience) {
  AliasEvidence evidence{EvidenceOptions()};
  evidence.Likelihood(std::vector<double>(50, 0.0), Places(50), 1200, 20, 0);
  EXPECT_NEAR(evidence.Level(), 0.02 * 1200, 1e-9);
  EXPECT_LT(Experienced(50, 3.0).Level(), 4.0);
}

TEST(AliasEvidence, ARevisitDoesNotRaiseTheLevel) {
  AliasEvidence evidence = Experienced(100, 5.0);
  const double before = evidence.Level();
  std::mt19937 random(2);
  for (int i = 0; i < 100; ++i) {
    std::vector<double> counts = Resemblances(100, 5.0, random);
    counts[40] = 60.0;
    evidence.Learn(counts, Places(100), {38, 39, 40, 41, 42}, 0.02);
  }
  EXPECT_NEAR(evidence.Level(), before, 0.5);
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

TEST(AliasEvidence, AnImageThatRepeatsLittleNeedsLess) {
  AliasEvidence evidence = Experienced(100, 5.0);  // images that share 20 with those before
  std::vector<double> counts(100, 0.5);
  counts[7] = 5.0;
  AliasEvidence same = evidence;
  const double as_usual = same.Likelihood(counts, Places(100), 1200, 20, 0).places[7];
  const double in_the_dark = evidence.Likelihood(counts, Places(100), 1200, 4, 0).places[7];
  EXPECT_LT(as_usual, 2.0);
  EXPECT_GT(in_the_dark, 5.0);
  AliasEvidence bright = Experienced(100, 5.0);
  EXPECT_EQ(bright.Likelihood(counts, Places(100), 1200, 80, 0).places[7],
            as_usual);  // never more than usual
}

TEST(AliasEvidence, APlaceThatEveryImageResemblesNeedsMore) {
  AliasEvidence evidence{EvidenceOptions()};
  std::mt19937 random(3);
  for (int i = 0; i < 200; ++i) {
    std::vector<double> counts = Resemblances(100, 4.0, random);
    counts[11] = 12.0;  // a blank wall
    evidence.Likelihood(counts, Places(100), 1200, 20, 0);
    evidence.Learn(counts, Places(100), {}, 1.0);
  }
  EXPECT_GT(evidence.LevelOf(11), 1.5 * evidence.LevelOf(12));
  EXPECT_LE(evidence.LevelOf(11), 3.0 * EvidenceOptions().alias_share * evidence.Level() + 1e-9);
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

TEST(AliasEvidence, LearnsHowLongWrongPlacesLast) {
  EXPECT_LT(AfterAliasesThatLast(1).Lasting(), 0.2);
  EXPECT_NEAR(AfterAliasesThatLast(2).Lasting(), 0.5, 0.15);
  EXPECT_GT(AfterAliasesThatLast(10).Lasting(), 0.8);
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
  internal::ByteWriter out;
  evidence.Save(out);
  AliasEvidence loaded{EvidenceOptions()};
  internal::ByteReader in(out.bytes(), "memory");
  loaded.Load(in);
  EXPECT_EQ(loaded.Level(), evidence.Level());
  for (int slot = 0; slot < 50; ++slot) EXPECT_EQ(loaded.LevelOf(slot), evidence.LevelOf(slot));
  EXPECT_EQ(loaded.Lasting(), evidence.Lasting());
  // Level, sum of words, first images (4 bytes), images, what images repeat, of how many, what lasts.
  for (const std::size_t at : {0, 8, 20, 28, 36, 44}) {
    std::string damaged = out.bytes();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::memcpy(damaged.data() + at, &nan, sizeof nan);
    AliasEvidence refuses{EvidenceOptions()};
    internal::ByteReader bad(damaged, "memory");
    EXPECT_THROW(refuses.Load(bad), InputError) << "at byte " << at;
  }
}

// A member's weight after images in which it repeats so much and is wrong so much.
double WeightOf(double repeated, double wrong) {
  MemberWeight weight;
  std::vector<double> counts(40, 0.0);
  counts[30] = wrong;
  for (int i = 0; i < 50; ++i) {
    weight.Repeat(repeated);
    weight.Learn(counts, Places(40), {3, 4, 5});
  }
  return weight.Value();
}

TEST(MemberWeight, IsLargeForWhatRepeatsAndIsNotWrong) {
  EXPECT_GT(WeightOf(20, 2), 5 * WeightOf(20, 10));  // matches everything everywhere
  EXPECT_GT(WeightOf(20, 2), 20 * WeightOf(0, 2));   // sees nothing again
  EXPECT_GT(WeightOf(0, 0), 0.0);                    // but may come to
}

TEST(MemberWeight, LearnsNothingFromWhereTheImageWasTaken) {
  MemberWeight weight;
  std::vector<double> counts(40, 0.0);
  counts[4] = 100;
  weight.Repeat(20);
  weight.Learn(counts, Places(40), {3, 4, 5});
  EXPECT_NEAR(weight.Value(), 20.1, 1e-9);
}

// Counts of a member that looks at the same images as another: partly alike, or the same but for chance.
std::vector<double> Alike(const std::vector<double>& counts, double noise, std::mt19937& random) {
  std::normal_distribution<double> normal(0.0, noise);
  std::vector<double> alike;
  alike.reserve(counts.size());
  for (const double count : counts) alike.push_back(std::max(0.0, count + normal(random)));
  return alike;
}

TEST(MemberOverlap, CountsAMemberThatSaysTheSameOnceAndLeavesOthersAlone) {
  MemberOverlap overlap;
  EXPECT_EQ(overlap.Copies(0), 1.0);
  EXPECT_EQ(overlap.Copies(7), 1.0);
  std::mt19937 random(1);
  for (int i = 0; i < 50; ++i) {
    const std::vector<double> first = Resemblances(100, 10, random);
    const std::vector<double> copy = Alike(first, 0.3, random);   // correlation 0.995
    const std::vector<double> other = Alike(first, 4.0, random);  // 0.58
    overlap.Learn({&first, &copy, &other}, Places(100), {});
  }
  EXPECT_NEAR(overlap.Copies(0), 2.0, 0.1);
  EXPECT_NEAR(overlap.Copies(1), 2.0, 0.1);
  EXPECT_NEAR(overlap.Copies(2), 1.0, 0.05);
}

TEST(MemberOverlap, LearnsNothingFromWhereTheImageWasTakenNorFromWhoSatOut) {
  MemberOverlap overlap;
  std::mt19937 random(2);
  for (int i = 0; i < 50; ++i) {
    std::vector<double> first = Resemblances(100, 10, random);
    std::vector<double> second = Resemblances(100, 10, random);
    for (std::size_t slot = 40; slot < 45; ++slot) first[slot] = second[slot] = 500;  // both know the place
    overlap.Learn({&first, &second, nullptr}, Places(100), {40, 41, 42, 43, 44});
  }
  EXPECT_LT(overlap.Copies(0), 1.05);
  EXPECT_EQ(overlap.Copies(2), 1.0);
}

TEST(MemberOverlap, GoesOnWhereItWasSavedAndRefusesDamage) {
  MemberOverlap overlap;
  std::mt19937 random(3);
  const std::vector<double> first = Resemblances(100, 10, random);
  overlap.Learn({&first, &first}, Places(100), {});
  internal::ByteWriter out;
  overlap.Save(out);
  MemberOverlap again;
  internal::ByteReader in(out.bytes(), "memory");
  again.Load(in);
  EXPECT_EQ(again.Copies(1), overlap.Copies(1));
  std::string damaged(out.bytes());
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::memcpy(damaged.data() + damaged.size() - sizeof nan, &nan, sizeof nan);
  internal::ByteReader bad(damaged, "memory");
  EXPECT_THROW(again.Load(bad), InputError);
  damaged.assign(out.bytes());
  damaged[0] = 3;  // members: as many as there are not
  internal::ByteReader wrong(damaged, "memory");
  EXPECT_THROW(again.Load(wrong), InputError);
}

}  // namespace
}  // namespace tutti
