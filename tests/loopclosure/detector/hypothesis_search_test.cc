#include "loopclosure/detector/hypothesis_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <vector>

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

  LoopResult Search(int query, int place, const HypothesisSearch::VerifyPair& verify) {
    return SearchWhere(query, {{place, 0.9}}, verify);
  }

  LoopResult SearchWhere(int query, const std::map<int, double>& posterior,
                         const HypothesisSearch::VerifyPair& verify) {
    Belief belief;
    belief.places.assign(kSearchPlaces, 0.0);
    for (const auto& [place, value] : posterior) belief.places[static_cast<std::size_t>(place)] = value;
    const HypothesisSearch search(options_, memory_, verify, [&](int slot) -> const View& {
      return views_[static_cast<std::size_t>(slot)];
    });
    LoopResult result;
    View view;
    view.id = query;
    view.size = {640, 480};
    search.Verify(view, belief, result);
    return result;
  }

  // `alike`: whether geometry finds two images alike, by their ids.
  LoopResult SearchAlike(int query, int place, const std::function<bool(std::int64_t, std::int64_t)>& alike) {
    return Search(query, place, [&](const View& a, const View& b, int) {
      Verification verification;
      verification.candidate = b.id;
      verification.similar = verification.accepted = alike(a.id, b.id);
      verification.inliers = verification.accepted ? kInliers : 5;
      verification.type = ConstraintType::kFundamental;
      return verification;
    });
  }

  LoopDetectorOptions options_;
  LocationMemory memory_;
  std::vector<View> views_;
};

TEST_F(HypothesisSearchTest, WhatWasInSightAllTheTimeIsNoReturn) {
  const LoopResult result = SearchAlike(kSearchPlaces - 1, 40, [](auto, auto) { return true; });
  EXPECT_FALSE(result.accepted);
  EXPECT_THAT(result.reason, HasSubstr("in sight all the time"));
}

TEST_F(HypothesisSearchTest, AShortWayRoundAndBackIsAReturn) {
  const int query = kSearchPlaces - 1;
  const LoopResult result =
      SearchAlike(query, 40, [&](auto a, auto b) { return a == query && (b <= 42 || b >= 57); });
  EXPECT_TRUE(result.accepted);
  EXPECT_LE(std::abs(result.verification.candidate - 40), 2);
}

TEST_F(HypothesisSearchTest, AnOldPlaceIsAskedForItselfAlone) {
  const LoopResult result = SearchAlike(kSearchPlaces - 1, 5, [](auto, auto) { return true; });
  EXPECT_TRUE(result.accepted);
}

TEST_F(HypothesisSearchTest, AnImageByItselfHasNoWayThatLedToIt) {
  const LoopResult result = SearchAlike(1000, 40, [](auto, auto) { return true; });
  EXPECT_TRUE(result.accepted);
}

// From four short-term memories on nothing stays in sight; half-way between two images lies one of its own.
TEST_F(HypothesisSearchTest, WhatWasInSightIsAskedHalfWayOfARecentPlace) {
  const int query = kSearchPlaces - 1;
  const auto asked = [&](int place) {
    std::vector<std::int64_t> ids;
    SearchWhere(query, {{place, 0.9}}, [&](const View& a, const View& b, int) {
      EXPECT_EQ(a.id, query);
      ids.push_back(b.id);
      Verification verification;
      verification.candidate = b.id;
      verification.similar = verification.accepted = b.id == place;
      verification.inliers = verification.accepted ? kInliers : 5;
      return verification;
    });
    return ids;
  };
  const std::vector<std::int64_t> recent = asked(query - 40), old = asked(query - 41);
  ASSERT_GE(recent.size(), 2u);
  EXPECT_EQ(recent[1], query - 20);
  EXPECT_THAT(old, ::testing::Not(::testing::Contains(query - 21)));
}

TEST_F(HypothesisSearchTest, HalfOfTheInliersHalfWayAreTheSameThing) {
  for (const int between : {49, 50}) {
    const LoopResult result = Search(kSearchPlaces - 1, 39, [&](const View&, const View& b, int) {
      Verification verification;
      verification.candidate = b.id;
      verification.similar = verification.accepted = b.id == 39 || b.id == 49;
      verification.inliers = b.id == 39 ? kInliers : verification.accepted ? between : 5;
      return verification;
    });
    EXPECT_EQ(result.accepted, between == 49);
  }
}

// What is tried of an image by itself where geometry finds so many inliers and accepts nothing.
class OrderOfSearch : public HypothesisSearchTest {
 protected:
  std::vector<std::int64_t> Tried(const std::map<int, double>& posterior,
                                  const std::map<std::int64_t, int>& inliers = {}) {
    const LoopResult result = SearchWhere(1000, posterior, [&](const View&, const View& b, int) {
      Verification verification;
      verification.candidate = b.id;
      const auto found = inliers.find(b.id);
      verification.inliers = found == inliers.end() ? 5 : found->second;
      return verification;
    });
    EXPECT_FALSE(result.accepted);
    std::vector<std::int64_t> ids;
    for (const Verification& tried : result.tried) ids.push_back(tried.candidate);
    return ids;
  }
  using Ids = std::vector<std::int64_t>;
};

TEST_F(OrderOfSearch, PlacesComeByTheirPosteriorAndTheFirstOnesNeighboursBeforeTheNext) {
  EXPECT_EQ(Tried({{10, 0.2}, {25, 0.5}, {26, 0.02}, {24, 0.01}, {40, 0.1}, {5, 0.05}}),
            (Ids{25, 26, 24, 10, 40}));
}

TEST_F(OrderOfSearch, PlacesNextToATakenOneAreNoneOfTheirOwn) {
  EXPECT_EQ(Tried({{20, 0.5}, {21, 0.3}, {22, 0.2}, {23, 0.1}}), (Ids{20, 21, 19, 23}));
  options_.verification.neighbours = 0;
  EXPECT_EQ(Tried({{20, 0.5}, {21, 0.3}, {22, 0.2}, {23, 0.1}}), (Ids{20, 22}));
}

TEST_F(OrderOfSearch, OfTwoThatAreEquallyProbableTheNewerIsFirst) {
  options_.verification.neighbours = 0;
  EXPECT_EQ(Tried({{10, 0.3}, {30, 0.3}}), (Ids{30, 10}));
}

TEST_F(OrderOfSearch, NeighboursOfALaterPlaceAreTriedWhereItShowsHalfOfWhatALoopNeeds) {
  const std::map<int, double> posterior = {{10, 0.2}, {25, 0.5}};
  options_.verification.min_inliers = 30;
  EXPECT_EQ(Tried(posterior, {{10, 14}}), (Ids{25, 24, 26, 10}));
  EXPECT_EQ(Tried(posterior, {{10, 15}}), (Ids{25, 24, 26, 10, 9, 11}));
}

TEST_F(OrderOfSearch, OfAPlaceThatWasSeenOftenThreeNeighboursAreTried) {
  options_.verification.neighbours = 4;
  EXPECT_EQ(Tried({{20, 0.5}, {18, 0.03}, {22, 0.02}, {24, 0.01}}), (Ids{20, 18, 22, 24}));
}

TEST_F(OrderOfSearch, TheBestThatWasTriedIsToldThoughNothingIsAccepted) {
  const LoopResult result = SearchWhere(1000, {{10, 0.2}, {25, 0.5}}, [&](const View&, const View& b, int) {
    Verification verification;
    verification.candidate = b.id;
    verification.inliers = b.id == 10 ? 12 : 5;
    verification.reason = "reason of " + std::to_string(b.id);
    return verification;
  });
  EXPECT_EQ(result.verification.candidate, 10);
  EXPECT_EQ(result.reason, "reason of 10");
}

// A flat picture is `size` / 20 as large in the candidate as in the query.
std::vector<VerifiedMatch> MatchesOfAPicture(double size) {
  std::vector<VerifiedMatch> matches;
  for (int i = 0; i < 64; ++i) {
    const float x = static_cast<float>(i % 8 - 4);
    const float y = static_cast<float>(i / 8 - 4);
    const float scale = static_cast<float>(size);
    matches.push_back({{320 + 20 * x, 240 + 20 * y}, {320 + scale * x, 240 + scale * y}, -1, -1});
  }
  return matches;
}

TEST_F(HypothesisSearchTest, TheLoopIsSaidWithTheNearestViewOfThePlace) {
  for (View& view : views_) view.size = {640, 480};
  const LoopResult result = Search(1000, 20, [](const View&, const View& b, int) {
    Verification verification;
    verification.candidate = b.id;
    verification.similar = verification.accepted = b.id >= 16 && b.id <= 24;
    verification.inliers = b.id == 20 ? kInliers : kInliers - 10;  // place 20 shares the most
    verification.inlier_matches = MatchesOfAPicture(20 + static_cast<double>(b.id - 23));
    return verification;
  });
  EXPECT_TRUE(result.accepted);
  EXPECT_EQ(result.verification.candidate, 23);
  EXPECT_LE(result.tried.size(), 4U);
}

Verification Seen(double mass, double log_nfa) {
  Verification verification;
  verification.mass = mass;
  verification.log_nfa = log_nfa;
  return verification;
}

TEST(LoopProbability, GrowsWithBeliefAndWithWhatChanceCannotExplain) {
  EXPECT_LT(LoopProbability(Seen(0.2, -50)), LoopProbability(Seen(0.9, -50)));
  EXPECT_LT(LoopProbability(Seen(0.5, -10)), LoopProbability(Seen(0.5, -100)));
}

TEST(LoopProbability, NeedsBeliefAndGeometry) {
  const double threshold = LoopDetectorOptions().loop_threshold;
  EXPECT_GT(LoopProbability(Seen(0.95, -80)), threshold);
  EXPECT_LT(LoopProbability(Seen(0.5, 0)), threshold);     // sure of the place, and nothing to see of it
  EXPECT_LT(LoopProbability(Seen(0.01, -80)), threshold);  // a poster that hangs somewhere else, too
}

TEST(LoopProbability, IsAProbabilityForAnyInput) {
  for (const double mass : {0.0, 1.0}) {
    for (const double nfa : {-1e6, 0.0, 50.0}) {
      const double p = LoopProbability(Seen(mass, nfa));
      EXPECT_GT(p, 0.0);
      EXPECT_LT(p, 1.0 + 1e-12);
    }
  }
}

}  // namespace
}  // namespace tutti::internal
