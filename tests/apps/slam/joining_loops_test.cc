#include "apps/slam/joining_loops.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

namespace tutti {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr double kSceneDepth = 10, kStep = 2;  // m
constexpr int kLength = 100;                   // keyframes of each map

// Two maps of the same street, a keyframe every two metres: k of the first one, 100 + k of the second one,
// which has a frame of reference of its own. `drift`: of the second one, as a share of the way, to the side.
struct TwoMaps {
  explicit TwoMaps(double drift = 0, GraphKind kind = GraphKind::kSE3, double unit = 1) : graph(kind) {
    const Pose T_second_first(ExpSO3({0, 0.5, 0}), {30, 0, -70});
    for (int k = 0; k < 2 * kLength; ++k) {
      const bool second = k >= kLength;
      const double way = kStep * (k % kLength);
      Pose pose;
      pose.translation = {way, second ? drift * way : 0, 0};
      if (second) pose = T_second_first * pose;
      if (second) pose.translation /= unit;
      places.push_back({second ? 3 : 0, pose});
      graph.AddNode(k, Similarity(pose));
      if (k % kLength == 0) continue;
      const Pose step = places[static_cast<std::size_t>(k - 1)].T_world_camera.Inverse() * pose;
      graph.AddOdometry(k - 1, k, Similarity(step), MakeInformation(0.1, 0.01));
    }
  }

  // A loop says that the second map's keyframe stands beside the first map's `candidate`, `aside` metres.
  void Add(int candidate, int query, double aside = 0, double scale = 1) {
    LoopEdge loop;
    loop.candidate = candidate;
    loop.query = kLength + query;
    loop.S_candidate_query = Similarity(scale, Eigen::Quaterniond::Identity(), {0, 0, aside});
    loop.depth = kSceneDepth;
    loops.push_back(loop);
  }

  JoiningLoops Choose() const {
    return ChooseJoiningLoops(
        loops, [this](int k) { return places[static_cast<std::size_t>(k)]; }, graph, SlamOptions());
  }

  std::vector<LoopGate::Place> places;
  PoseGraph graph;
  std::vector<LoopEdge> loops;
};

TEST(JoiningLoops, ManyPlacesJoinAndWhatWasFoundFirstElsewhereStaysOutside) {
  TwoMaps maps;
  for (const int k : {50, 52, 54}) maps.Add(k, k - 40);  // 80 m away, and they agree with each other
  for (const int k : {20, 21, 40, 60}) maps.Add(k, k);
  const JoiningLoops joining = maps.Choose();
  EXPECT_THAT(joining.chosen, ElementsAre(3, 4, 5, 6));
  EXPECT_THAT(joining.reason, IsEmpty());
  for (const std::size_t outside : {0u, 1u, 2u})
    EXPECT_THAT(joining.reasons[outside], HasSubstr("4 loops at 3 places against 3 loops at 1 place"));
  EXPECT_THAT(joining.reasons[4], IsEmpty());
}

TEST(JoiningLoops, ManyImagesOfOnePlaceAreOnePlace) {
  TwoMaps maps;
  for (int k = 50; k < 55; ++k) {
    for (int shown = 0; shown < 3; ++shown) maps.Add(k, k - 40);
  }
  for (const int k : {20, 40}) maps.Add(k, k);
  EXPECT_THAT(maps.Choose().chosen, ElementsAre(15, 16));
}

TEST(JoiningLoops, NoneJoinsIfNeitherSideClearlyOutnumbersTheOther) {
  TwoMaps maps;
  for (const int k : {20, 40, 60}) maps.Add(k, k);
  for (const int k : {50, 60}) maps.Add(k, k - 40);
  JoiningLoops joining = maps.Choose();
  EXPECT_THAT(joining.chosen, IsEmpty());
  EXPECT_THAT(joining.reason, HasSubstr("3 loops at 3 places against 2 loops at 2 places"));
  for (const std::string& reason : joining.reasons) EXPECT_EQ(reason, joining.reason);
  maps.Add(80, 80);
  EXPECT_THAT(maps.Choose().chosen, ElementsAre(0, 1, 2, 5));
}

TEST(JoiningLoops, OneLoopAloneIsNoSetAndNoRival) {
  TwoMaps maps;
  EXPECT_THAT(maps.Choose().reason, HasSubstr("no loop"));
  maps.Add(20, 20);
  EXPECT_THAT(maps.Choose().reason, HasSubstr("the only verified loop"));
  maps.Add(50, 10);
  EXPECT_THAT(maps.Choose().reason, HasSubstr("no two of the 2 verified loops"));
  EXPECT_THAT(maps.Choose().chosen, IsEmpty());
  maps.Add(22, 22);  // the same place as the first one
  EXPECT_THAT(maps.Choose().chosen, ElementsAre(0, 2));
}

// What the ends of a long way differ by is too much for two loops beside each other.
TEST(JoiningLoops, MapsThatDriftAlongTheWayStillAgree) {
  constexpr double kDrift = 0.02;
  TwoMaps drifting(kDrift);
  for (const int k : {5, 35, 65, 95}) drifting.Add(k, k);
  EXPECT_THAT(drifting.Choose().chosen, ElementsAre(0, 1, 2, 3));
  TwoMaps straight;
  straight.Add(50, 50);
  straight.Add(51, 51);
  straight.Add(52, 52, kDrift * 90 * kStep);
  EXPECT_THAT(straight.Choose().chosen, ElementsAre(0, 1));
}

TEST(JoiningLoops, TheOrderInWhichTheyWereFoundDecidesNothing) {
  TwoMaps maps(0.01);
  for (const int k : {50, 52}) maps.Add(k, k - 40);
  for (const int k : {10, 30, 33, 60, 90}) maps.Add(k, k);
  const auto chosen = [&maps] {
    std::set<int> queries;
    for (const std::size_t i : maps.Choose().chosen) queries.insert(maps.loops[i].query - kLength);
    return queries;
  };
  const std::set<int> expected = {10, 30, 33, 60, 90};
  EXPECT_EQ(chosen(), expected);
  for (int turn = 0; turn < 6; ++turn) {
    std::rotate(maps.loops.begin(), maps.loops.begin() + 1, maps.loops.end());
    EXPECT_EQ(chosen(), expected) << turn;
  }
}

TEST(JoiningLoops, EachPieceOfAMapIsJoinedByItsOwnLoops) {
  TwoMaps maps;
  for (int k = 50; k < kLength; ++k) maps.places[static_cast<std::size_t>(k)].piece = 1;
  maps.graph = PoseGraph();
  for (int k = 0; k < 2 * kLength; ++k) {
    const LoopGate::Place& place = maps.places[static_cast<std::size_t>(k)];
    maps.graph.AddNode(k, Similarity(place.T_world_camera));
    if (k % kLength == 0 || k == 50) continue;
    const Pose step =
        maps.places[static_cast<std::size_t>(k - 1)].T_world_camera.Inverse() * place.T_world_camera;
    maps.graph.AddOdometry(k - 1, k, Similarity(step), MakeInformation(0.1, 0.01));
  }
  for (const int k : {20, 40, 60, 80, 90}) maps.Add(k, k);
  maps.Add(10, 30);
  EXPECT_THAT(maps.Choose().chosen, ElementsAre(0, 1, 2, 3, 4));
}

TEST(JoiningLoops, OneCamerasLoopsAgreeInTheScaleBetweenTheMaps) {
  constexpr double kUnit = 1.3;
  TwoMaps maps(0, GraphKind::kSim3, kUnit);
  for (const int k : {20, 40, 60}) maps.Add(k, k, 0, kUnit);
  maps.Add(21, 21, 0, 2 * kUnit);
  maps.Add(22, 22, 0, 2 * kUnit);
  EXPECT_THAT(maps.Choose().chosen, ElementsAre(0, 1, 2));
}

}  // namespace
}  // namespace tutti
