#include "loopclosure/detector/second_word.h"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "loopclosure/filter/bayes_filter.h"
#include "tutti/core/error.h"

namespace tutti::internal {
namespace {

constexpr int kPathLength = 60;
constexpr int kAsked = kPathLength - 1 - Hindsight::kImages;  // the image whose second word is due
constexpr int kPlace = 10;                                    // that it looks like

// A path of images; the last ones look more or less like the path from kPlace on.
class SecondWordTest : public ::testing::Test {
 protected:
  SecondWordTest() : memory_(10), views_(kPathLength) {
    for (int i = 0; i < kPathLength; ++i) {
      views_[static_cast<std::size_t>(i)].id = i;
      memory_.Add(i);
      transition_.Update(memory_, memory_.Settle());
    }
  }

  // How much more than a new place each image from kAsked on looks like the place that follows kPlace.
  void See(const std::vector<double>& likelihoods, bool accepted_at_first) {
    BayesFilter filter;
    for (int k = 0; k <= Hindsight::kImages; ++k) {
      Belief likelihood;
      likelihood.places.assign(kPathLength, elsewhere_);
      likelihood.places[kPlace + static_cast<std::size_t>(k)] = likelihoods[static_cast<std::size_t>(k)];
      filter.Step(transition_, memory_.working_memory(), likelihood);
      word_.Step(kAsked + k, filter.posterior(), likelihood);
      LoopResult result;
      result.query = kAsked + k;
      if (k == 1 && still_there_) {
        result.accepted = true;
        result.tried = {Geometry(kAsked, kPlace)};
        result.tried.front().candidate = kPlace + 1;
        result.verification = result.tried.front();
      }
      if (k == 0 && accepted_at_first) {
        result.accepted = true;
        result.tried = {Geometry(kAsked, kPlace)};
        result.verification = result.tried.front();
      }
      word_.Keep(kAsked + k, result);
    }
  }

  Verification Geometry(std::int64_t query, std::int64_t candidate) const {
    Verification v;
    v.candidate = candidate;
    v.matches = 100;
    v.type = ConstraintType::kFundamental;
    v.similar = query == kAsked && candidate == kPlace;
    v.accepted = v.similar && motion_is_known_;
    v.inliers = v.similar ? inliers_ : 5;
    v.log_nfa = v.similar ? -inliers_ : 0;
    if (v.similar) v.inlier_matches.resize(static_cast<std::size_t>(v.inliers));
    return v;
  }

  std::optional<LateLoop> Say(SecondWord* word) {
    const HypothesisSearch search(
        options_, memory_, [&](const View& q, const View& c, int) { return Geometry(q.id, c.id); },
        [&](int slot) -> const View& { return views_[static_cast<std::size_t>(slot)]; });
    return word->Say(options_, memory_, transition_, search);
  }

  // What a file has of word_, beside this memory.
  void Load(const LocationMemory& memory, SecondWord* loaded) {
    const std::string bytes = StateBytes(word_);
    SharedObjectsIn none;
    StateReader in(bytes, "test", &none);
    in(*loaded);
    in.ExpectEnd();
    loaded->Check(memory, in);
  }

  LoopDetectorOptions options_;
  TransitionModel transition_;
  LocationMemory memory_;
  std::vector<View> views_;
  SecondWord word_;
  double elsewhere_ = 0.4;  // likelihood of all other places
  int inliers_ = 80;        // of 100, where the images show one place
  bool motion_is_known_ = true;
  bool still_there_ = false;  // the image after the one that is asked about closes a loop by itself
};

TEST_F(SecondWordTest, WhatTheNextImagesBearOutIsAcceptedThoughItWasNotTriedAtFirst) {
  See({1.5, 6, 6, 6, 6, 6}, false);
  const std::optional<LateLoop> late = Say(&word_);
  ASSERT_TRUE(late);
  EXPECT_TRUE(late->accepted);
  EXPECT_FALSE(late->withdrawn);
  EXPECT_EQ(late->query, kAsked);
  EXPECT_EQ(late->verification.candidate, kPlace);
  EXPECT_EQ(late->verification.inlier_matches.size(), 80u);
  EXPECT_GE(late->probability, options_.loop_threshold);
}

TEST_F(SecondWordTest, WhatTheNextImagesContradictIsWithdrawn) {
  inliers_ = 15;
  elsewhere_ = 0.05;
  See({0.05, 0.05, 0.05, 0.05, 0.05, 0.05}, true);
  const std::optional<LateLoop> late = Say(&word_);
  ASSERT_TRUE(late);
  EXPECT_TRUE(late->withdrawn);
  EXPECT_FALSE(late->accepted);
  EXPECT_EQ(late->verification.candidate, kPlace);
  EXPECT_LT(late->probability, 0.5);
}

TEST_F(SecondWordTest, APlaceWithoutAMotionMustBeThereStillForAnImageSince) {
  motion_is_known_ = false;
  See({1.5, 6, 6, 6, 6, 6}, false);
  EXPECT_FALSE(Say(&word_)) << "it may be seen from afar, and have been left";
  SecondWord other;
  std::swap(word_, other);
  still_there_ = true;
  See({1.5, 6, 6, 6, 6, 6}, false);
  const std::optional<LateLoop> late = Say(&word_);
  ASSERT_TRUE(late);
  EXPECT_TRUE(late->accepted);
  EXPECT_EQ(late->verification.candidate, kPlace);
}

TEST_F(SecondWordTest, WhereTwoOfTheImagesBeforeCloseLoopsHalfTheBeliefIsEnough) {
  const auto said = [this](int links, bool motion_is_known) {
    for (int k = 1; k <= links; ++k) memory_.AddLink(kAsked - k, kPlace - k, LocationMemory::LinkType::kLoop);
    motion_is_known_ = motion_is_known;
    SecondWord fresh;
    std::swap(word_, fresh);
    See({0.5, 0.6, 0.6, 0.6, 0.6, 0.6}, false);
    const std::optional<LateLoop> late = Say(&word_);
    for (int k = 1; k <= links; ++k) memory_.RemoveLoop(kAsked - k, kPlace - k);
    return late ? late->probability : 0.0;
  };
  EXPECT_EQ(said(0, true), 0);
  EXPECT_EQ(said(1, true), 0) << "one may be of what only looks alike";
  EXPECT_GT(said(2, true), 0.5);
  EXPECT_LT(said(2, true), options_.loop_threshold);
  EXPECT_EQ(said(2, false), 0);
}

TEST_F(SecondWordTest, NothingIsSaidWhereNothingChanges) {
  See({30, 6, 6, 6, 6, 6}, true);
  EXPECT_FALSE(Say(&word_));
  SecondWord other;
  std::swap(word_, other);
  See({0.4, 0.4, 0.4, 0.4, 0.4, 0.4}, false);
  EXPECT_FALSE(Say(&word_));
}

TEST_F(SecondWordTest, AThresholdThatIsLowWithdrawsNothingOfItself) {
  options_.loop_threshold = 0;
  inliers_ = 15;
  elsewhere_ = 0.05;
  See({0.05, 0.05, 0.05, 0.05, 0.05, 0.05}, true);
  EXPECT_FALSE(Say(&word_));
}

// Rules with several filters never step, and without verification nothing is ever said.
TEST_F(SecondWordTest, KeepsNoMoreThanItWaitsFor) {
  const auto size = [&] { return StateBytes(word_).size(); };
  LoopResult result;
  const std::size_t empty = size();
  for (int slot = 0; slot < kPathLength; ++slot) word_.Keep(slot, result);
  EXPECT_EQ(size(), empty) << "no step was made";
  See({0.4, 0.4, 0.4, 0.4, 0.4, 0.4}, false);
  const std::size_t full = size();
  See({0.4, 0.4, 0.4, 0.4, 0.4, 0.4}, false);
  EXPECT_EQ(size(), full);
}

TEST_F(SecondWordTest, IsTheSameAfterAFile) {
  See({1.5, 6, 6, 6, 6, 6}, false);
  SecondWord loaded;
  Load(memory_, &loaded);
  const std::optional<LateLoop> late = Say(&loaded);
  ASSERT_TRUE(late);
  EXPECT_EQ(late->probability, Say(&word_)->probability);
}

TEST_F(SecondWordTest, AFileOfALoopWithAnUnknownLocationIsDamaged) {
  See({30, 6, 6, 6, 6, 6}, true);
  LocationMemory shorter(10);
  for (int i = 0; i < kAsked; ++i) shorter.Add(i);
  SecondWord loaded;
  EXPECT_THROW(Load(shorter, &loaded), InputError);
}

}  // namespace
}  // namespace tutti::internal
