#include "apps/slam/loop_gate.h"

#include <gtest/gtest.h>

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

TEST(LoopGate, FirstLoopWaitsAndEntersWithTheSecondThatAgrees) {
  LoopGate gate{SlamOptions()};
  EXPECT_TRUE(gate.Offer(LoopTo(10), {}, PlaceOf).empty());
  ASSERT_EQ(gate.waiting().size(), 1u);
  const auto entering = gate.Offer(LoopTo(12), {}, PlaceOf);
  ASSERT_EQ(entering.size(), 2u);
  EXPECT_EQ(entering[0].candidate, 10);
  EXPECT_EQ(entering[1].candidate, 12);
  EXPECT_TRUE(gate.waiting().empty());
}

TEST(LoopGate, LoopsThatContradictEachOtherStayOut) {
  LoopGate gate{SlamOptions()};
  EXPECT_TRUE(gate.Offer(LoopTo(10), {}, PlaceOf).empty());
  EXPECT_TRUE(gate.Offer(LoopTo(12, 3.0), {}, PlaceOf).empty());
  EXPECT_TRUE(gate.Offer(LoopTo(14, -3.0), {}, PlaceOf).empty());
  EXPECT_EQ(gate.waiting().size(), 3u);
}

TEST(LoopGate, LoopsFarApartDoNotVouchForEachOther) {
  LoopGate gate{SlamOptions()};
  EXPECT_TRUE(gate.Offer(LoopTo(1), {}, PlaceOf).empty());
  EXPECT_TRUE(gate.Offer(LoopTo(90), {}, PlaceOf).empty());
}

TEST(LoopGate, LoopThatTheMapAlreadySaysEntersAlone) {
  LoopGate gate{SlamOptions()};
  LoopEdge loop = LoopTo(10);
  loop.S_candidate_query.translation = {5, 0, 0};  // as in the drifted map
  EXPECT_EQ(gate.Offer(loop, {}, PlaceOf).size(), 1u);
}

TEST(LoopGate, AcceptedLoopsVouchForLaterOnes) {
  LoopGate gate{SlamOptions()};
  EXPECT_EQ(gate.Offer(LoopTo(13), {LoopTo(10)}, PlaceOf).size(), 1u);
}

TEST(LoopGate, ScaleMustAgreeToo) {
  LoopGate gate{SlamOptions()};
  EXPECT_TRUE(gate.Offer(LoopTo(10), {}, PlaceOf).empty());
  LoopEdge other = LoopTo(10);
  other.candidate_frame = 11;
  other.S_candidate_query.scale = 1.5;
  EXPECT_TRUE(gate.Offer(other, {}, PlaceOf).empty());
}

TEST(LoopGate, OneConfirmationTrustsEachLoopAlone) {
  SlamOptions options;
  options.loop_confirmations = 1;
  LoopGate gate{options};
  EXPECT_EQ(gate.Offer(LoopTo(10), {}, PlaceOf).size(), 1u);
}

}  // namespace
}  // namespace tutti
