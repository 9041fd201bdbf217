#include "apps/slam/missed_loops.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti {
namespace {

constexpr double kDepth = 10;
constexpr int kCorners = 40;  // of a round of 400 m, one keyframe each

// Keyframes on a round that ends where it began; the last one stands `off` metres beside the first.
struct OpenRound {
  std::vector<StandingKeyframe> keyframes;
  PoseGraph graph{GraphKind::kSE3};
  explicit OpenRound(double off) {
    for (int i = 0; i <= kCorners; ++i) {
      const double angle = 2 * M_PI * i / kCorners, radius = 400 / (2 * M_PI) + off * i / kCorners;
      const Pose pose(ExpSO3({0, -angle, 0}), {radius * std::cos(angle), 0, radius * std::sin(angle)});
      keyframes.push_back({i, 0, pose, kDepth});
      graph.AddNode(i, pose);
      if (i == 0) continue;
      const Pose step = keyframes[static_cast<std::size_t>(i - 1)].T_world_camera.Inverse() * pose;
      graph.AddOdometry(i - 1, i, Similarity(step), MakeInformation(0.1, 0.01));
    }
  }
  std::vector<MissedLoop> Missed() const { return FindMissedLoops(keyframes, graph, SlamOptions()); }
};

TEST(MissedLoops, TheOpenEndOfARoundIsFoundWithTheNearestCandidateFirst) {
  const std::vector<MissedLoop> missed = OpenRound(4).Missed();
  ASSERT_FALSE(missed.empty());
  EXPECT_EQ(missed.back().query, kCorners);
  ASSERT_FALSE(missed.back().candidates.empty());
  EXPECT_EQ(missed.back().candidates.front(), 0);
  for (const MissedLoop& loop : missed) EXPECT_GE(loop.query, kCorners - 2);
}

TEST(MissedLoops, WhatALoopTiesAlreadyIsNotMissed) {
  OpenRound round(4);
  round.graph.AddLoop(0, kCorners, Similarity(), MakeInformation(0.1, 0.01));
  EXPECT_DOUBLE_EQ(WaysFrom(0, round.graph).at(kCorners).length, 0);
  EXPECT_EQ(WaysFrom(0, round.graph).at(kCorners).edges, 1);
  EXPECT_EQ(WaysFrom(0, round.graph).at(2).edges, 2);
  EXPECT_TRUE(round.Missed().empty());
}

TEST(MissedLoops, PlacesFartherApartThanTheWayCanHaveDriftedAreNone) {
  EXPECT_TRUE(OpenRound(40).Missed().empty());
}

TEST(MissedLoops, WhoLooksTheOtherWayOrStandsInAnotherPieceSeesSomethingElse) {
  OpenRound turned(4);
  turned.keyframes.front().T_world_camera.rotation = ExpSO3({0, M_PI, 0});
  for (const MissedLoop& loop : turned.Missed()) {
    for (const int candidate : loop.candidates) EXPECT_NE(candidate, 0);
  }
  OpenRound apart(4);
  apart.keyframes.back().piece = 1;
  for (const MissedLoop& loop : apart.Missed()) EXPECT_NE(loop.query, kCorners);
}

}  // namespace
}  // namespace tutti
