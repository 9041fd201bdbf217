#include "apps/slam/missed_loops.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

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

CameraRig SceneRig(Sensor sensor) {
  CameraRig rig;
  rig.sensor = sensor;
  rig.camera.width = 640;
  rig.camera.height = 480;
  rig.camera.fx = rig.camera.fy = 500;
  rig.camera.cx = 319.5;
  rig.camera.cy = 239.5;
  return rig;
}

// Landmarks of a scene, as the camera at T_scene_camera sees them.
KeyframeView ViewOf(unsigned scene, const Pose& T_scene_camera, int landmarks) {
  std::mt19937 generator(scene);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(generator() % 100000) / 1e5;
  };
  KeyframeView view;
  view.descriptors = cv::Mat(landmarks, 32, CV_8U);
  for (int i = 0; i < landmarks; ++i) {
    const double x = uniform(-3, 3), y = uniform(-2, 2), z = uniform(8, 12);
    const Eigen::Vector3d point = T_scene_camera.Inverse() * Eigen::Vector3d(x, y, z);
    const Eigen::Vector2d pixel = SceneRig(Sensor::kStereo).camera.Project(point);
    view.keypoints.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 31.0F);
    view.points.push_back(point);
    view.landmarks.push_back(i);
    for (int b = 0; b < 32; ++b)
      view.descriptors.at<std::uint8_t>(i, b) = static_cast<std::uint8_t>(generator());
  }
  return view;
}

TEST(MissedLoops, TheSameLandmarksTellWhereTheQueryStands) {
  const Pose moved(ExpSO3({0.02, -0.05, 0.01}), {0.4, -0.1, 0.8});
  const KeyframeView candidate = ViewOf(1, Pose(), 40), query = ViewOf(1, moved, 40);
  for (const Sensor sensor : {Sensor::kStereo, Sensor::kMono}) {
    const Verification found = VerifyLandmarks(candidate, query, SceneRig(sensor), VerificationOptions(), 1);
    ASSERT_TRUE(found.accepted) << found.reason;
    EXPECT_EQ(found.type == ConstraintType::kSimilarity, sensor == Sensor::kMono);
    EXPECT_LT((found.S_candidate_query.translation - moved.translation).norm(), 1e-3);
    EXPECT_GE(found.inliers, 35);
  }
}

TEST(MissedLoops, WhatLiesInOneSpotOfTheImageIsNoLoop) {
  const KeyframeView wide = ViewOf(1, Pose(), 40);
  KeyframeView spot = wide;  // a sign of 0.6 x 0.4 m, 10 m away
  for (std::size_t i = 0; i < spot.points.size(); ++i) {
    spot.points[i].x() *= 0.1;
    spot.points[i].y() *= 0.1;
    const Eigen::Vector2d pixel = SceneRig(Sensor::kStereo).camera.Project(spot.points[i]);
    spot.keypoints[i].pt = {static_cast<float>(pixel.x()), static_cast<float>(pixel.y())};
  }
  const auto verified = [](const KeyframeView& view) {
    return VerifyLandmarks(view, view, SceneRig(Sensor::kStereo), VerificationOptions(), 1);
  };
  EXPECT_TRUE(verified(wide).accepted);
  EXPECT_GE(verified(spot).inliers, 35);
  EXPECT_FALSE(verified(spot).accepted);
  EXPECT_FALSE(verified(spot).reason.empty());
}

TEST(MissedLoops, AnotherSceneOrAHandfulOfLandmarksIsNoLoopAndSaysWhy) {
  const KeyframeView candidate = ViewOf(1, Pose(), 40);
  for (const KeyframeView& query : {ViewOf(2, Pose(), 40), ViewOf(1, Pose(), 8)}) {
    const Verification found =
        VerifyLandmarks(candidate, query, SceneRig(Sensor::kStereo), VerificationOptions(), 1);
    EXPECT_FALSE(found.accepted);
    EXPECT_FALSE(found.reason.empty());
  }
}

}  // namespace
}  // namespace tutti
