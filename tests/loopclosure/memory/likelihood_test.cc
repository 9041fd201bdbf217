#include "loopclosure/memory/likelihood.h"

#include <gtest/gtest.h>

#include <map>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/state_archive.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

TEST(Likelihood, SimilarityWalksTheInvertedIndexToTheSameNumberAsThePair) {
  LikelihoodModel model(LikelihoodKind::kSimilarity);
  const Signature a({1, 1, 2, 3});
  const Signature b({1, 4, 4, 9, 9});
  model.Add(a);
  model.Add(b);
  const Signature query({1, 1, 1, 4});
  const std::vector<double> scores = model.Scores(query);
  EXPECT_DOUBLE_EQ(scores[0], Signature::Similarity(query, a));
  EXPECT_DOUBLE_EQ(scores[1], Signature::Similarity(query, b));
}

TEST(Likelihood, TfIdfAddsTermFrequencyTimesInverseDocumentFrequency) {
  LikelihoodModel model(LikelihoodKind::kTfIdf);
  model.Add(Signature({1, 1, 2, 3}));  // n = 4
  model.Add(Signature({1, 5}));        // n = 2
  model.Add(Signature({8, 9}));
  const std::vector<double> scores = model.Scores(Signature({1, 2, 2, 77}));
  // Word 1 is in two of three locations, word 2 in one; the query's own counts do not matter.
  EXPECT_NEAR(scores[0], 2.0 / 4.0 * std::log10(3.0 / 2.0) + 1.0 / 4.0 * std::log10(3.0 / 1.0), 1e-12);
  EXPECT_NEAR(scores[1], 1.0 / 2.0 * std::log10(3.0 / 2.0), 1e-12);
  EXPECT_EQ(scores[2], 0.0);
}

SeenWords WordsSeen(std::vector<int> words, std::vector<int> cells) {
  SeenWords seen;
  seen.words = std::move(words);
  seen.cells = std::move(cells);
  return seen;
}

TEST(Likelihood, CountsFollowTheEquation) {
  LikelihoodModel model(LikelihoodKind::kTfIdf);
  model.Add(Signature({1, 1, 2, 3}));
  model.Add(Signature({1, 5}));
  model.Add(Signature({8, 9}));
  // Word 1 twice, in cells 0 and 6; word 2 in cell 1, of the same strip as 0; 77 and -1 nobody knows.
  const std::vector<double> counts = model.Counts(WordsSeen({1, 1, 2, 77, -1}, {0, 6, 1, 2, 3}));
  const double one =
      std::log10(3.0 / 2.0) / std::log10(3.0) / 2;  // an occurrence of 1, at each of its two cells
  const double first_strip = std::log1p(2 * one) + std::log1p(1.0);
  const double last_strip = std::log1p(2 * one);
  EXPECT_NEAR(counts[0], std::pow(first_strip, 0.75) + std::pow(last_strip, 0.75), 1e-12);
  EXPECT_NEAR(counts[1], 2 * std::pow(std::log1p(one), 0.75), 1e-12);
  EXPECT_EQ(counts[2], 0.0);
}

TEST(Likelihood, WhatAgreesInOneSpotCountsLessThanWhatAgreesAllOver) {
  LikelihoodModel model(LikelihoodKind::kTfIdf);
  for (int i = 0; i < 10; ++i) {
    std::vector<int> words(20);
    for (int w = 0; w < 20; ++w) words[static_cast<std::size_t>(w)] = 100 * i + w;
    model.Add(Signature(words));
  }
  std::vector<int> words, one_spot, all_over;
  for (int w = 0; w < 20; ++w) {
    words.push_back(300 + w);
    one_spot.push_back(9);
    all_over.push_back(w * 2);
  }
  EXPECT_GT(model.Counts(WordsSeen(words, all_over))[3], 3 * model.Counts(WordsSeen(words, one_spot))[3]);
}

TEST(Likelihood, WhatHasBeenInSightInBetweenIsNoSignOfAReturn) {
  // Word 1 drives ahead from slot 4 on and is hidden now and then; word 2 is back in the newest; word 3 was
  // seen twice in between, which is seldom; word 4 twice since slot 10, which is half of the images since.
  LikelihoodModel model(LikelihoodKind::kTfIdf);
  constexpr int kNewest = 25;
  const std::map<int, std::vector<int>> seen = {{1, {4, 8, 12, 13, 18, 22, kNewest}},
                                                {2, {0, kNewest}},
                                                {3, {2, 9, 17, kNewest}},
                                                {4, {19, 20, 22, kNewest}}};
  for (int slot = 0; slot <= kNewest; ++slot) {
    std::vector<int> words = {100 + slot};
    for (const auto& [word, slots] : seen) {
      if (std::count(slots.begin(), slots.end(), slot) > 0) words.push_back(word);
    }
    model.Add(Signature(words));
  }
  const auto counted = [&](int word, int slot) {
    const SeenWords newest = WordsSeen({word}, {0});
    const double all = model.Counts(newest)[static_cast<std::size_t>(slot)];
    EXPECT_GT(all, 0.0);
    const double returns = model.Counts(newest, {24})[static_cast<std::size_t>(slot)];
    EXPECT_TRUE(returns == 0.0 || returns == all);
    return returns > 0.0;
  };
  EXPECT_FALSE(counted(1, 4)) << "in sight, though never for long at a time";
  EXPECT_FALSE(counted(1, 8));
  EXPECT_TRUE(counted(2, 0)) << "a return";
  EXPECT_TRUE(counted(3, 2)) << "two of 22 images: out of sight for most of the time";
  EXPECT_FALSE(counted(4, 19)) << "two of five images";
  EXPECT_TRUE(counted(4, 22)) << "less than two images in between say nothing";
  EXPECT_TRUE(counted(1, kNewest)) << "short-term memory counts in full";
}

TEST(Likelihood, ASlotThatComesBackCountsAsIfItHadNeverBeenAway) {
  LikelihoodModel model(LikelihoodKind::kTfIdf);
  for (int slot = 0; slot < 8; ++slot) model.Add(Signature({1, 10 + slot, 20 + slot % 2}));
  const SeenWords query = WordsSeen({1, 20, 21, 13}, {0, 2, 4, 6});
  const std::vector<double> before = model.Counts(query, {6});
  model.Remove(3);
  model.Restore(3, Signature({1, 13, 21}));
  EXPECT_EQ(model.Counts(query, {6}), before);
}

TEST(Likelihood, CellsCoverTheImageAndWhatLiesOutsideIsInTheNearest) {
  const cv::Size wide(640, 240);
  EXPECT_EQ(SeenWords::Cell({0, 0}, wide), 0);
  EXPECT_EQ(SeenWords::Cell({639, 239}, wide), 2 * 8 + 7);
  EXPECT_EQ(SeenWords::Cell({-5, 1e5f}, wide), 2 * 8);
  EXPECT_EQ(SeenWords::Cell({5, 5}, cv::Size()), 0);
}

TEST(Likelihood, ARemovedLocationCountsNoMore) {
  LikelihoodModel model(LikelihoodKind::kTfIdf);
  model.Add(Signature({1, 2}));
  model.Add(Signature({1, 3}));
  model.Add(Signature({4, 5}));
  model.Remove(1);
  model.Remove(1);
  EXPECT_EQ(model.NumLocations(), 2);
  const std::vector<double> scores = model.Scores(Signature({1, 3}));
  EXPECT_NEAR(scores[0], 0.5 * std::log10(2.0), 1e-12);
  EXPECT_EQ(scores[1], 0.0);
}

TEST(Likelihood, AdjustmentFollowsTheEquations) {
  const std::vector<double> scores = {0.1, 0.1, 0.1, 0.5, 0.0};
  const Belief adjusted = AdjustLikelihood(scores, {0, 1, 2, 3, 4});
  const double mean = 0.2;
  const double sigma = std::sqrt((3 * 0.01 + 0.09) / 3.0);  // sample deviation over the non-zero ones
  EXPECT_NEAR(adjusted.places[3], (0.5 - (sigma - 1e-4)) / mean, 1e-12);
  EXPECT_EQ(adjusted.places[0], 1.0);
  EXPECT_EQ(adjusted.places[4], 1.0);
  EXPECT_NEAR(adjusted.new_place, mean / sigma + 1.0, 1e-12);
}

TEST(Likelihood, WhereNothingStandsOutTheNewPlaceGetsTwo) {
  EXPECT_EQ(AdjustLikelihood({0.3, 0.3, 0.3}, {0, 1, 2}).new_place, 2.0);
  EXPECT_EQ(AdjustLikelihood({0.0, 0.0}, {0, 1}).new_place, 2.0);
  EXPECT_EQ(AdjustLikelihood({0.4}, {0}).new_place, 2.0);
  EXPECT_EQ(AdjustLikelihood({}, {}).new_place, 2.0);
}

TEST(Likelihood, OnlyWorkingMemoryEntersTheAdjustment) {
  const Belief adjusted = AdjustLikelihood({0.1, 0.1, 0.1, 0.5, 0.9}, {0, 1, 2, 3});
  EXPECT_EQ(adjusted.places[4], 0.0);
  EXPECT_GT(adjusted.places[3], 1.0);
}

TEST(Likelihood, ASavedOneWithWordsOfALocationThatIsNotThereIsRefused) {
  for (const bool present : {true, false}) {
    const std::string bytes = internal::StateBytes(std::uint64_t{1}, present, Signature({4, 4, 9}));
    LikelihoodModel model(LikelihoodKind::kTfIdf);
    if (present) {
      internal::ReadStateBytes(bytes, "test", model);
      EXPECT_TRUE(model.Has(0));
      EXPECT_EQ(model.signature(0).size(), 3);
    } else {
      EXPECT_THROW(internal::ReadStateBytes(bytes, "test", model), InputError);
    }
  }
}

}  // namespace
}  // namespace tutti
