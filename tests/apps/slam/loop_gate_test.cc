#include "apps/slam/loop_gate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace tutti {
namespace {

// Keyframe k stands at x = k in piece 0, and the map drifts: from keyframe 100 on everything is 5 m off.
LoopGate::Place PlaceOf(int id) {
  LoopGate::Place place;
  place.T_world_camera.translation = {static_cast<double>(id % 100) + (id >= 100 ? 5.0 : 0.0), 0, 0};
  return place;
}

// The truth: keyframe 100 + k stands where keyframe k stood; `error` [m] makes it a false loop.
LoopEdge LoopTo(int candidate, double error = 0) {
  LoopEdge loop;
  loop.candidate = candidate;
  loop.query = candidate + 100;
  loop.candidate_frame = candidate;
  loop.query_frame = candidate + 100;
  loop.S_candidate_query.translation = {error, 0, 0};
  loop.depth = 10;
  return loop;
}

// With the loops that wait, as LoopCloser keeps them.
class Gate : public LoopGate {
 public:
  using LoopGate::LoopGate;
  Admitted Admit(const LoopEdge& loop, const std::vector<LoopEdge>& accepted, const Places& map,
                 bool across = false, const Trusts& trusts = {}) {
    Admitted admitted = LoopGate::Admit(loop, waiting_, accepted, map, across, trusts);
    if (admitted.loops.empty()) waiting_.push_back(loop);
    for (const LoopEdge& entering : admitted.loops) {
      waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(),
                                    [&](const LoopEdge& l) { return l.query == entering.query; }),
                     waiting_.end());
    }
    return admitted;
  }
  const std::vector<LoopEdge>& waiting() const { return waiting_; }

 private:
  std::vector<LoopEdge> waiting_;
};

TEST(LoopGate, FirstLoopWaitsAndEntersWithTheSecondThatAgrees) {
  Gate gate{SlamOptions()};
  EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf).loops.empty());
  ASSERT_EQ(gate.waiting().size(), 1u);
  const auto entering = gate.Admit(LoopTo(12), {}, PlaceOf).loops;
  ASSERT_EQ(entering.size(), 2u);
  EXPECT_EQ(entering[0].candidate, 10);
  EXPECT_EQ(entering[1].candidate, 12);
  EXPECT_TRUE(gate.waiting().empty());
}

TEST(LoopGate, LoopsThatContradictEachOtherStayOut) {
  Gate gate{SlamOptions()};
  EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf).loops.empty());
  EXPECT_TRUE(gate.Admit(LoopTo(12, 3.0), {}, PlaceOf).loops.empty());
  EXPECT_TRUE(gate.Admit(LoopTo(14, -3.0), {}, PlaceOf).loops.empty());
  EXPECT_EQ(gate.waiting().size(), 3u);
}

TEST(LoopGate, LoopsAgreeWhereABadOdometryMayHaveDriftedByTheirDifference) {
  const auto enter = [](const OdometryUncertainty::Sigmas& step, const LoopEdge& second) {
    Gate gate{SlamOptions()};
    gate.SetOdometryUncertainty(step);
    gate.Admit(LoopTo(10), {}, PlaceOf);
    return gate.Admit(second, {}, PlaceOf).loops.size();
  };
  const OdometryUncertainty::Sigmas good{0.005, 0.0005}, bad{0.05, 0.01};
  const LoopEdge shifted = LoopTo(12, 0.5), shifted_more = LoopTo(12, 1.0);  // 4 m on, 0.2 m is the limit
  LoopEdge turned = LoopTo(12), turned_more = turned;  // 4 steps on, 1.5 deg is the limit
  turned.S_candidate_query.rotation = ExpSO3({0, 0, 0.05});
  turned_more.S_candidate_query.rotation = ExpSO3({0, 0, 0.12});
  EXPECT_EQ(enter(good, shifted), 0u);
  EXPECT_EQ(enter(good, turned), 0u);
  EXPECT_EQ(enter(bad, shifted), 2u);
  EXPECT_EQ(enter(bad, turned), 2u);
  EXPECT_EQ(enter(bad, shifted_more), 0u);
  EXPECT_EQ(enter(bad, turned_more), 0u) << "nothing is let in beyond four times the limits";
}

TEST(LoopGate, LoopsFarApartDoNotVouchForEachOther) {
  Gate gate{SlamOptions()};
  EXPECT_TRUE(gate.Admit(LoopTo(1), {}, PlaceOf).loops.empty());
  EXPECT_TRUE(gate.Admit(LoopTo(90), {}, PlaceOf).loops.empty());
}

TEST(LoopGate, LoopThatTheMapAlreadySaysEntersAlone) {
  Gate gate{SlamOptions()};
  LoopEdge loop = LoopTo(10);
  loop.S_candidate_query.translation = {5, 0, 0};  // as in the drifted map
  EXPECT_EQ(gate.Admit(loop, {}, PlaceOf).loops.size(), 1u);
}

TEST(LoopGate, WhatLoopsErrThemselvesIsNoContradiction) {
  const LoopGate gate{SlamOptions()};
  const auto loop = [](int candidate, double error) {  // 0.1 m and 0.01 rad are one standard deviation
    LoopEdge edge = LoopTo(candidate, 5 + error);
    edge.information.diagonal() << 100, 100, 100, 1e4, 1e4, 1e4, 1e4;
    return edge;
  };
  const auto within = [&](double first, double second) {
    return gate.WithinNoise({loop(10, first), loop(20, second)}, PlaceOf);
  };
  EXPECT_TRUE(within(0, 0));
  EXPECT_TRUE(within(0.24, -0.24));
  EXPECT_TRUE(within(0.33, 0));  // in the mean
  EXPECT_FALSE(within(0.25, 0.25));
  LoopEdge turned = loop(10, 0);
  turned.S_candidate_query.rotation = ExpSO3({0, 0, 0.03});
  EXPECT_FALSE(gate.WithinNoise({turned}, PlaceOf));
  LoopEdge scaled = loop(10, 0);
  scaled.S_candidate_query.scale = 1.03;
  EXPECT_FALSE(gate.WithinNoise({scaled}, PlaceOf));
  const auto two_pieces = [](int id) {
    LoopGate::Place place = PlaceOf(id);
    place.piece = id / 100;
    return place;
  };
  EXPECT_FALSE(gate.WithinNoise({loop(10, 0)}, two_pieces));  // it would join them
}

TEST(LoopGate, AcceptedLoopsVouchForLaterOnes) {
  Gate gate{SlamOptions()};
  EXPECT_EQ(gate.Admit(LoopTo(13), {LoopTo(10)}, PlaceOf).loops.size(), 1u);
}

TEST(LoopGate, ScaleMustAgreeToo) {
  Gate gate{SlamOptions()};
  EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf).loops.empty());
  LoopEdge other = LoopTo(11);
  other.S_candidate_query.scale = 1.5;
  EXPECT_TRUE(gate.Admit(other, {}, PlaceOf).loops.empty());
}

TEST(LoopGate, DrivesAtDifferentTimesVouchForEachOtherOnlyAcrossThem) {
  for (const bool across : {false, true}) {
    Gate gate{SlamOptions()};
    EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf).loops.empty());
    LoopEdge other = LoopTo(12);
    other.query_frame += 100000;  // of another recording, whose keyframes stand beside the first one's
    EXPECT_EQ(gate.Admit(other, {}, PlaceOf, across).loops.size(), across ? 2u : 0u);
  }
  Gate gate{SlamOptions()};
  EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf).loops.empty());
  LoopEdge far = LoopTo(30);  // 20 m on, 10 m deep
  far.query_frame += 100000;
  EXPECT_TRUE(gate.Admit(far, {}, PlaceOf, true).loops.empty());
}

TEST(LoopGate, TheSameTwoKeyframesAgainAreNoSecondLoop) {
  Gate gate{SlamOptions()};
  EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf).loops.empty());
  EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf).loops.empty());
}

// A hand that shakes, and rows that are read one after the other.
TEST(LoopGate, ThreeThatAgreeRoughlyEnterWhereTwoMustAgreeClosely) {
  LoopEdge beside = LoopTo(14);
  beside.S_candidate_query.translation = {0.15, 0.26, 0};
  Gate gate{SlamOptions()};
  EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf).loops.empty());
  EXPECT_TRUE(gate.Admit(LoopTo(12, 0.3), {}, PlaceOf).loops.empty()) << "0.2 m is the limit";
  EXPECT_EQ(gate.Admit(beside, {}, PlaceOf).loops.size(), 3u) << "0.3 m from both";
  EXPECT_TRUE(gate.waiting().empty());

  Gate apart{SlamOptions()};
  for (const double error : {0.0, 0.5, 1.0, 1.5}) {
    EXPECT_TRUE(apart.Admit(LoopTo(10 + static_cast<int>(4 * error), error), {}, PlaceOf).loops.empty());
  }
}

// Where a place looks like another one, several images in a row say so, and agree.
TEST(LoopGate, LoopsThatAreDoubtfulDoNotVouchForEachOther) {
  Gate gate{SlamOptions()};
  const auto weak = [](const LoopEdge&) { return LoopGate::Trust::kWeak; };
  for (const int k : {10, 15, 20, 25}) {
    EXPECT_TRUE(gate.Admit(LoopTo(k), {}, PlaceOf, false, weak).loops.empty()) << k;
  }
  SlamOptions alone;
  alone.loop_confirmations = 1;
  EXPECT_TRUE(Gate(alone).Admit(LoopTo(10), {}, PlaceOf, false, weak).loops.empty());
}

TEST(LoopGate, ADoubtfulLoopIsAWitnessForASureOneThatSawSomethingElse) {
  const auto weak = [](const LoopEdge& loop) {
    return loop.candidate < 20 ? LoopGate::Trust::kWeak : LoopGate::Trust::kSure;
  };
  for (const bool doubtful_first : {true, false}) {
    for (const int apart : {2, 4}) {  // m, of a depth of 10
      Gate gate{SlamOptions()};
      const LoopEdge sure = LoopTo(20), doubtful = LoopTo(20 - apart);
      EXPECT_TRUE(gate.Admit(doubtful_first ? doubtful : sure, {}, PlaceOf, false, weak).loops.empty());
      const auto admitted = gate.Admit(doubtful_first ? sure : doubtful, {}, PlaceOf, false, weak);
      ASSERT_EQ(admitted.loops.size(), apart > 3 ? 2u : 0u) << "doubtful first: " << doubtful_first;
      if (apart > 3) {
        EXPECT_EQ(admitted.witness->candidate, (doubtful_first ? doubtful : sure).candidate);
      }
    }
  }
}

TEST(LoopGate, ADoubtfulLoopMustAgreeAsAnyOther) {
  Gate gate{SlamOptions()};
  const auto weak = [](const LoopEdge& loop) {
    return loop.candidate < 20 ? LoopGate::Trust::kWeak : LoopGate::Trust::kSure;
  };
  gate.Admit(LoopTo(20), {}, PlaceOf, false, weak);
  EXPECT_TRUE(gate.Admit(LoopTo(15, 0.5), {}, PlaceOf, false, weak).loops.empty());
  LoopEdge turned = LoopTo(14);
  turned.S_candidate_query.rotation = ExpSO3({0, 0, 0.05});
  EXPECT_TRUE(gate.Admit(turned, {}, PlaceOf, false, weak).loops.empty());
  EXPECT_EQ(gate.Admit(LoopTo(13), {}, PlaceOf, false, weak).loops.size(), 2u);
}

// Where the odometry would have to have failed altogether.
TEST(LoopGate, LoopsThatAreFarFetchedEnterWithThreeThatSawDifferentThings) {
  const auto far = [](const LoopEdge&) { return LoopGate::Trust::kFar; };
  for (const int step : {2, 4}) {  // m, of a depth of 10
    Gate gate{SlamOptions()};
    EXPECT_TRUE(gate.Admit(LoopTo(10), {}, PlaceOf, false, far).loops.empty());
    EXPECT_TRUE(gate.Admit(LoopTo(10 + step), {}, PlaceOf, false, far).loops.empty());
    EXPECT_EQ(gate.Admit(LoopTo(10 - step), {}, PlaceOf, false, far).loops.size(), step > 3 ? 3u : 0u)
        << step;
  }
}

TEST(LoopGate, AnImageThatTurnsOnTheSpotSeesSomethingElse) {
  const auto turned = [](int id) {
    LoopGate::Place place = PlaceOf(id);
    if (id % 100 == 11) place.T_world_camera.rotation = ExpSO3({0, 0.5, 0});
    return place;
  };
  EXPECT_FALSE(LoopGate::Independent(LoopTo(10), LoopTo(12), turned));
  EXPECT_TRUE(LoopGate::Independent(LoopTo(10), LoopTo(11), turned));
}

TEST(LoopGate, ADoubtfulLoopThatTheMapSaysTooEntersAndTakesNoOtherAlong) {
  Gate gate{SlamOptions()};
  const auto weak = [](const LoopEdge&) { return LoopGate::Trust::kWeak; };
  LoopEdge in_map = LoopTo(14);
  in_map.S_candidate_query.translation = {5, 0, 0};  // as in the drifted map
  gate.Admit(LoopTo(10), {}, PlaceOf, false, weak);
  EXPECT_EQ(gate.Admit(in_map, {}, PlaceOf, false, weak).loops.size(), 1u);
  EXPECT_EQ(gate.waiting().size(), 1u);
}

TEST(LoopGate, OneConfirmationTrustsEachLoopAlone) {
  SlamOptions options;
  options.loop_confirmations = 1;
  Gate gate{options};
  EXPECT_EQ(gate.Admit(LoopTo(10), {}, PlaceOf).loops.size(), 1u);
}

}  // namespace
}  // namespace tutti
