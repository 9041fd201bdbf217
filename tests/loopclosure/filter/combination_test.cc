#include "loopclosure/filter/combination.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti {
namespace {

Belief Make(double new_place, std::vector<double> places) {
  Belief belief;
  belief.new_place = new_place;
  belief.places = std::move(places);
  return belief;
}

LocationMemory Memory(int n) {
  LocationMemory memory(1);
  for (int i = 0; i <= n; ++i) memory.Add(i);
  memory.Settle();
  return memory;
}

TEST(Combination, MeanAveragesEveryLocationAndTheNewPlace) {
  const Belief a = Make(0.8, {0.2, 0.0});
  const Belief b = Make(0.2, {0.4, 0.4});
  const Belief mean = CombineMean({&a, &b});
  EXPECT_NEAR(mean.new_place, 0.5, 1e-12);
  EXPECT_NEAR(mean.places[0], 0.3, 1e-12);
  EXPECT_NEAR(mean.places[1], 0.2, 1e-12);
  EXPECT_NEAR(mean.Hypothesis(), 0.5, 1e-12);
}

TEST(Combination, MeanTakesTheUnionOfLocations) {
  const Belief a = Make(0.5, {0.5});
  const Belief b = Make(0.5, {0.1, 0.4});
  EXPECT_NEAR(CombineMean({&a, &b}).places[1], 0.2, 1e-12);
}

TEST(Combination, TheLogPoolIsTheGeometricMeanAndOfTwoAlikeTheSameAsOfOne) {
  const Belief a = Make(0.5, {0.4, 0.1});
  const Belief b = Make(0.2, {0.1, 0.7});
  const Belief pool = CombineLogPool({&a, &b}, {0, 1});
  const double sum = std::sqrt(0.5 * 0.2) + std::sqrt(0.4 * 0.1) + std::sqrt(0.1 * 0.7);
  EXPECT_NEAR(pool.new_place, std::sqrt(0.5 * 0.2) / sum, 1e-12);
  EXPECT_NEAR(pool.places[1], std::sqrt(0.1 * 0.7) / sum, 1e-12);
  const Belief twice = CombineLogPool({&a, &a}, {0, 1});
  EXPECT_NEAR(twice.places[0], 0.4, 1e-12);
}

TEST(Combination, ProductIsRenormalisedAndFlooredSoThatNoMemberCanVeto) {
  const Belief a = Make(0.5, {0.5, 0.0});
  const Belief b = Make(0.5, {0.0, 0.5});
  const Belief product = CombineProduct({&a, &b}, {0, 1});
  const double sum = 0.25 + 2 * 0.5e-9;
  EXPECT_NEAR(product.new_place, 0.25 / sum, 1e-12);
  EXPECT_NEAR(product.places[0], 0.5e-9 / sum, 1e-15);
}

TEST(Combination, MajorityNeedsTwoVotesThatAgreeWithinTwoLevels) {
  const LocationMemory memory = Memory(20);
  Belief a = Make(0.4, std::vector<double>(21, 0.0));
  Belief b = a;
  Belief c = a;
  a.places[5] = 0.6;
  b.places[7] = 0.6;
  c.places[15] = 0.6;
  const CombinedBelief agreed = CombineMajority({&a, &b, &c}, 0.11, memory);
  EXPECT_NEAR(agreed.hypothesis, 2.0 / 3.0 * 0.6, 1e-12);
  EXPECT_EQ(agreed.best, 5);
  b.places[7] = 0.0;
  b.places[8] = 0.6;
  EXPECT_EQ(CombineMajority({&a, &b, &c}, 0.11, memory).hypothesis, 0.0);
}

TEST(Combination, MajorityIgnoresMembersBelowTheThreshold) {
  const LocationMemory memory = Memory(10);
  Belief a = Make(0.95, std::vector<double>(11, 0.0));
  a.places[3] = 0.05;
  const Belief b = a;
  EXPECT_EQ(CombineMajority({&a, &b}, 0.11, memory).hypothesis, 0.0);
}

TEST(Combination, WithoutMembersThereIsNoHypothesis) {
  const LocationMemory memory = Memory(5);
  for (const CombinationRule rule :
       {CombinationRule::kMean, CombinationRule::kProduct, CombinationRule::kMajority,
        CombinationRule::kNaive, CombinationRule::kSingle}) {
    const CombinedBelief combined = Combine(rule, {}, 0.11, memory);
    EXPECT_EQ(combined.hypothesis, 0.0);
    EXPECT_EQ(combined.best, -1);
  }
}

}  // namespace
}  // namespace tutti
