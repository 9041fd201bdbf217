// What a memory makes of each image's words: counts, and what it knows from the images just before.
#include "loopclosure/filter/memory_system.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>
#include <vector>

#include "loopclosure/features/whole_image.h"

namespace tutti::internal {
namespace {

constexpr int kStmOfTest = 5;
constexpr int kImagesOfWalk = 40;

// Two members with a joint filter, the second one dense if asked for. Each image shares some words with the
// few before, and the second half of the walk some with the first.
class MemorySystemTest : public ::testing::TestWithParam<bool> {
 protected:
  MemorySystemTest() {
    options_.members = {"orb", GetParam() ? "hog" : "sift"};
    options_.rule = CombinationRule::kJoint;
    options_.stm_size = kStmOfTest;
    options_.rehearsal = false;
    for (const std::string& name : options_.members) members_.emplace_back(name, options_, 1);
    system_.emplace(0, options_, std::vector<std::vector<std::size_t>>{{0}, {1}}, members_);
  }

  SeenWords Seen(int image, int member) {
    SeenWords seen;
    if (member == 1 && GetParam()) {
      cv::Mat of_place(1, 16, CV_32F), noise(1, 16, CV_32F);
      cv::RNG(static_cast<std::uint64_t>(1 + image % 20)).fill(of_place, cv::RNG::NORMAL, 0, 1);
      cv::RNG(static_cast<std::uint64_t>(100 + image)).fill(noise, cv::RNG::NORMAL, 0, 0.3);
      seen.descriptor = NormalisedDescriptor(of_place + noise);
      return seen;
    }
    for (int i = 0; i < 30; ++i) {
      const bool of_place = i < 20, is_known = random_() % 4 != 0;
      const int place = image % 20 + (of_place ? 0 : static_cast<int>(random_() % 4));
      seen.words.push_back(is_known ? 100 * place + i : 10000 * (image + 1) + i);
      seen.cells.push_back(static_cast<int>(random_() % 48));
    }
    return seen;
  }

  void See(int image) { system_->Remember(image, {Seen(image, 0), Seen(image, 1)}); }
  void Step() {
    for (std::size_t u = 0; u < 2; ++u) {
      system_->UpdateLikelihood(u);
      system_->StepFilter(u);
    }
    system_->StepJoint();
  }
  const FilterUnit& Unit(std::size_t u) const { return system_->units()[u]; }
  const std::vector<int>& WorkingMemory() const { return system_->memory().working_memory(); }

  std::mt19937 random_{9};
  LoopDetectorOptions options_;
  std::vector<Member> members_;
  std::optional<MemorySystem> system_;
};
INSTANTIATE_TEST_SUITE_P(WithADenseMember, MemorySystemTest, ::testing::Bool());

double CountOf(const std::vector<double>& counts, int slot) { return counts[static_cast<std::size_t>(slot)]; }

// It is half of that for a dense member, which compares whole sequences.
TEST_P(MemorySystemTest, WhatAMemberRepeatsIsItsMeanCountForThreeImagesBefore) {
  for (int image = 0; image < kImagesOfWalk; ++image) {
    See(image);
    Step();
    const int before = std::min(3, image);
    if (before == 0) continue;
    for (std::size_t u = 0; u < 2; ++u) {
      double sum = 0;
      for (int k = 1; k <= before; ++k) sum += CountOf(Unit(u).counts, image - k);
      EXPECT_NEAR(Unit(u).repeated, sum / before * (Unit(u).is_dense ? 0.5 : 1.0), 1e-12) << image;
    }
    system_->Learn();
  }
}

// Each filter's evidence is told what its own image has, repeats, and has in common with the one before.
TEST_P(MemorySystemTest, EvidenceIsThatOfTheCountsAndOfWhatTheImageBeforeHas) {
  for (int image = 0; image < kImagesOfWalk; ++image) {
    See(image);
    std::vector<AliasEvidence> alias = {Unit(0).alias, Unit(1).alias};
    AliasEvidence of_joint = system_->joint()->alias;
    Step();
    if (WorkingMemory().empty()) continue;
    double words = 0, repeated = 0;
    const auto expect = [&](AliasEvidence& before, const PlaceFilter& filter, double of_words,
                            double repeats) {
      const double own = std::max(1.0, CountOf(filter.counts, image));
      const double overlap = std::min(1.0, CountOf(filter.counts, image - 1) / own);
      const Belief expected = before.Likelihood(filter.counts, WorkingMemory(), of_words, repeats, overlap);
      for (const int slot : WorkingMemory())
        EXPECT_NEAR(CountOf(filter.image_likelihood.places, slot), CountOf(expected.places, slot), 1e-9)
            << image;
    };
    for (std::size_t u = 0; u < 2; ++u) {
      const double own_words = Unit(u).is_dense ? DenseModel::kWords : 30;
      expect(alias[u], Unit(u), own_words, Unit(u).repeated);
      words += own_words;
      repeated += system_->WeightOf(u) * Unit(u).repeated;
    }
    expect(of_joint, *system_->joint(), words, repeated);
    system_->Learn();
  }
}

TEST_P(MemorySystemTest, TheJointCountIsTheWeightedSumAndWeightsAreOneInTheMean) {
  for (int image = 0; image < kImagesOfWalk; ++image) {
    See(image);
    Step();
    system_->Learn();
  }
  See(kImagesOfWalk);
  Step();
  const double first = system_->WeightOf(0), second = system_->WeightOf(1);
  EXPECT_NE(first, second);
  const double ratio = Unit(0).weight.Value() / Unit(1).weight.Value();
  EXPECT_NEAR(first / second, ratio, 0.02 * ratio) << "members that say different things";
  EXPECT_NEAR(first + second, 2, 0.02);
  for (const int slot : WorkingMemory())
    EXPECT_NEAR(CountOf(system_->joint()->counts, slot),
                first * CountOf(Unit(0).counts, slot) + second * CountOf(Unit(1).counts, slot), 1e-9);
}

TEST_P(MemorySystemTest, AMemberThatSitsOutLeavesItsShareToTheOther) {
  for (int image = 0; image < kImagesOfWalk; ++image) {
    See(image);
    Step();
    system_->Learn();
  }
  system_->Remember(kImagesOfWalk, {Seen(kImagesOfWalk, 0), SeenWords()});
  Step();
  EXPECT_NEAR(system_->WeightOf(0), 2, 0.02);
  EXPECT_EQ(system_->WeightOf(1), 0);
}

TEST_P(MemorySystemTest, AnImageByItselfIsWhereItsCountsSay) {
  for (int image = 0; image < kImagesOfWalk; ++image) {
    See(image);
    Step();
    system_->Learn();
  }
  const std::vector<Belief> opinions = system_->Opinions({Seen(7, 0), Seen(7, 1)});
  ASSERT_EQ(opinions.size(), 1u) << "the joint filter's";
  double sum = opinions[0].new_place;
  for (const double place : opinions[0].places) sum += place;
  EXPECT_NEAR(sum, 1, 1e-9);
  EXPECT_EQ(opinions[0].Best() % 20, 7);
}

}  // namespace
}  // namespace tutti::internal
