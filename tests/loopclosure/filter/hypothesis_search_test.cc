#include "loopclosure/filter/hypothesis_search.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>

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
    search.Verify(view, belief, result);
    return result;
  }

  // `alike`: whether geometry finds two images alike, by their ids.
  LoopResult SearchAlike(int query, int place, const std::function<bool(std::int64_t, std::int64_t)>& alike) {
    return Search(query, place, [&](const View& a, const View& b, int) {
      Verification verification;
      verification.candidate = b.id;
      verification.accepted = alike(a.id, b.id);
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
      verification.accepted = b.id == place;
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
      verification.accepted = b.id == 39 || b.id == 49;
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

TEST_F(OrderOfSearch, IslandsAreRankedByAllThatLiesNear) {
  options_.verification.neighbours = 0;
  options_.verification.max_hypotheses = 2;
  options_.island_levels = 2;
  EXPECT_EQ(Tried({{10, 0.3}, {30, 0.2}, {31, 0.15}, {45, 0.05}}), (Ids{30, 10}));
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

// An image by itself, of which the belief says place 20. Where geometry finds it alike, and how much.
class ClimbTest : public HypothesisSearchTest {
 protected:
  std::int64_t Best(const std::map<std::int64_t, int>& inliers) {
    const LoopResult result = Search(1000, 20, [&](const View&, const View& b, int) {
      Verification verification;
      verification.candidate = b.id;
      const auto found = inliers.find(b.id);
      verification.accepted = found != inliers.end();
      verification.inliers = verification.accepted ? found->second : 5;
      verification.type = ConstraintType::kRigid;
      return verification;
    });
    EXPECT_TRUE(result.accepted);
    return result.verification.candidate;
  }
};

TEST_F(ClimbTest, TheViewOnThePathThatSharesTheMostIsTaken) {
  EXPECT_EQ(Best({{19, 90}, {20, 100}, {21, 90}}), 20);
  EXPECT_EQ(Best({{19, 120}, {20, 100}, {21, 110}}), 19);
  EXPECT_EQ(Best({{19, 110}, {20, 100}, {21, 120}}), 21);
}

TEST_F(ClimbTest, AFewViewsThatShareLessMayLieBetween) {
  EXPECT_EQ(Best({{20, 100}, {21, 90}, {22, 76}, {23, 150}}), 23);
  EXPECT_EQ(Best({{20, 100}, {21, 90}, {22, 74}, {23, 150}}), 20) << "three quarters are too few";
  EXPECT_EQ(Best({{20, 100}, {21, 90}, {22, 90}, {23, 90}, {24, 150}}), 20) << "three in vain";
}

TEST_F(ClimbTest, AViewFurtherThanEightLocationsIsNoneOfThePlace) {
  std::map<std::int64_t, int> inliers;
  for (int id = 20; id < 40; ++id) inliers[id] = 80 + id;
  EXPECT_EQ(Best(inliers), 28);
  inliers.clear();
  for (int id = 20; id > 5; --id) inliers[id] = 120 - id;
  EXPECT_EQ(Best(inliers), 12);
}

// The same, where geometry knows the direction of the translation alone. All views share about as much, place
// 20 the most.
class NearestViewTest : public HypothesisSearchTest {
 protected:
  // `aside_deg`: how much the query lies aside of the direction of each view.
  std::int64_t Nearest(const std::map<std::int64_t, double>& aside_deg) {
    const LoopResult result = Search(1000, 20, [&](const View& a, const View& b, int) {
      Verification verification;
      verification.candidate = b.id;
      verification.type = ConstraintType::kEssential;
      const auto found = aside_deg.find(b.id);
      verification.accepted = found != aside_deg.end();
      verification.inliers = !verification.accepted ? 5 : b.id == 20 ? kInliers : others_;
      const double aside = a.id != 1000 ? turn_deg_ : verification.accepted ? found->second : 0;
      verification.ahead = std::cos(aside * M_PI / 180);
      return verification;
    });
    EXPECT_TRUE(result.accepted);
    return result.verification.candidate;
  }

  int others_ = 90;      // inliers of the other views
  double turn_deg_ = 0;  // by which the path's views lie aside of each other
};

TEST_F(NearestViewTest, IsTheOneThatTheQueryLiesClearlyMoreAsideOf) {
  EXPECT_EQ(Nearest({{20, 5}, {21, 6.5}}), 20) << "noise";
  EXPECT_EQ(Nearest({{20, 5}, {21, 7.5}}), 21);
  EXPECT_EQ(Nearest({{20, 5}, {19, 7.5}}), 19);
  EXPECT_EQ(Nearest({{20, 5}, {21, 6.5}, {22, 7.5}, {23, 12}}), 23);
  EXPECT_EQ(Nearest({{20, 5}, {21, 3}, {22, 2}, {19, 4}}), 20);
}

TEST_F(NearestViewTest, IsNoneThatSharesMuchLess) {
  others_ = 76;
  EXPECT_EQ(Nearest({{20, 5}, {21, 12}}), 21);
  others_ = 74;
  EXPECT_EQ(Nearest({{20, 5}, {21, 12}}), 20);
}

TEST_F(NearestViewTest, OnBothSidesIsNoise) { EXPECT_EQ(Nearest({{19, 12}, {20, 5}, {21, 12}}), 20); }

TEST_F(NearestViewTest, IsLookedForAlongAStraightPathAlone) {
  turn_deg_ = 16;
  EXPECT_EQ(Nearest({{20, 5}, {21, 12}}), 21);
  turn_deg_ = 20;
  EXPECT_EQ(Nearest({{20, 5}, {21, 12}}), 20);
}

TEST_F(NearestViewTest, IsNearEnoughWhereTheQueryLiesBeside) {
  EXPECT_EQ(Nearest({{20, 21}, {21, 40}}), 21);
  EXPECT_EQ(Nearest({{20, 23}, {21, 40}}), 20);
  EXPECT_EQ(Nearest({{20, 5}, {21, 23}, {22, 40}}), 21);
}

TEST_F(NearestViewTest, IsLookedForAsLongAsItComesNearer) {
  EXPECT_EQ(Nearest({{20, 5}, {21, 5}, {22, 5}, {23, 12}}), 23);
  EXPECT_EQ(Nearest({{20, 5}, {21, 5}, {22, 5}, {23, 5}, {24, 12}}), 20) << "three in vain";
  EXPECT_EQ(Nearest({{20, 1}, {21, 4}, {22, 7}, {23, 10}, {24, 13}, {25, 16}, {26, 19}}), 25) << "too far";
}

}  // namespace
}  // namespace tutti::internal
