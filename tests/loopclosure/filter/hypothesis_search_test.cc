#include "loopclosure/filter/hypothesis_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace tutti::internal {
namespace {

using ::testing::HasSubstr;

constexpr int kSearchPlaces = 60;
constexpr int kInliers = 100;

// A path of kSearchPlaces images; the newest is the query, and the belief points at one place of the path.
class HypothesisSearchTest : public ::testing::Test {
 protected:
  HypothesisSearchTest() : memory_(options_.stm_size), views_(kSearchPlaces) {
    for (int i = 0; i < kSearchPlaces; ++i) {
      views_[static_cast<std::size_t>(i)].id = i;
      memory_.Add(i);
      memory_.Settle();
    }
  }

  // `alike`: whether geometry finds two images alike, by their ids.
  LoopResult Search(int query, int place, const std::function<bool(std::int64_t, std::int64_t)>& alike) {
    Belief belief;
    belief.places.assign(kSearchPlaces, 0.0);
    belief.places[static_cast<std::size_t>(place)] = 0.9;
    const HypothesisSearch search(
        options_, memory_,
        [&](const View& a, const View& b, int) {
          Verification verification;
          verification.candidate = b.id;
          verification.accepted = alike(a.id, b.id);
          verification.inliers = verification.accepted ? kInliers : 5;
          verification.type = ConstraintType::kFundamental;
          return verification;
        },
        [&](int slot) -> const View& { return views_[static_cast<std::size_t>(slot)]; });
    LoopResult result;
    View view;
    view.id = query;
    search.Verify(view, belief, result);
    return result;
  }

  LoopDetectorOptions options_;
  LocationMemory memory_;
  std::vector<View> views_;
};

TEST_F(HypothesisSearchTest, WhatWasInSightAllTheTimeIsNoReturn) {
  const LoopResult result = Search(kSearchPlaces - 1, 40, [](auto, auto) { return true; });
  EXPECT_FALSE(result.accepted);
  EXPECT_THAT(result.reason, HasSubstr("in sight all the time"));
}

TEST_F(HypothesisSearchTest, AShortWayRoundAndBackIsAReturn) {
  const int query = kSearchPlaces - 1;
  const LoopResult result =
      Search(query, 40, [&](auto a, auto b) { return a == query && (b <= 42 || b >= 57); });
  EXPECT_TRUE(result.accepted);
  EXPECT_LE(std::abs(result.verification.candidate - 40), 2);
}

TEST_F(HypothesisSearchTest, AnOldPlaceIsAskedForItselfAlone) {
  const LoopResult result = Search(kSearchPlaces - 1, 5, [](auto, auto) { return true; });
  EXPECT_TRUE(result.accepted);
}

TEST_F(HypothesisSearchTest, AnImageByItselfHasNoWayThatLedToIt) {
  const LoopResult result = Search(1000, 40, [](auto, auto) { return true; });
  EXPECT_TRUE(result.accepted);
}

}  // namespace
}  // namespace tutti::internal
