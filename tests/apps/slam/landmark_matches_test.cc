#include "apps/slam/landmark_matches.h"

#include <gtest/gtest.h>

#include <random>

namespace tutti {
namespace {

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

TEST(LandmarkMatches, TheSameLandmarksTellWhereTheQueryStands) {
  const Pose moved(ExpSO3({0.02, -0.05, 0.01}), {0.4, -0.1, 0.8});
  const KeyframeView candidate = ViewOf(1, Pose(), 40), query = ViewOf(1, moved, 40);
  for (const Sensor sensor : {Sensor::kStereo, Sensor::kMono}) {
    const Verification found = VerifyLandmarks(candidate, query, SceneRig(sensor), LoopDetectorOptions());
    ASSERT_TRUE(found.accepted) << found.reason;
    EXPECT_EQ(found.type == ConstraintType::kSimilarity, sensor == Sensor::kMono);
    EXPECT_LT((found.S_candidate_query.translation - moved.translation).norm(), 1e-3);
    EXPECT_GE(found.inliers, 35);
  }
}

TEST(LandmarkMatches, WhatLiesInOneSpotOfTheImageIsNoLoop) {
  const KeyframeView wide = ViewOf(1, Pose(), 40);
  KeyframeView spot = wide;  // a sign of 0.6 x 0.4 m, 10 m away
  for (std::size_t i = 0; i < spot.points.size(); ++i) {
    spot.points[i].x() *= 0.1;
    spot.points[i].y() *= 0.1;
    const Eigen::Vector2d pixel = SceneRig(Sensor::kStereo).camera.Project(spot.points[i]);
    spot.keypoints[i].pt = {static_cast<float>(pixel.x()), static_cast<float>(pixel.y())};
  }
  const auto verified = [](const KeyframeView& view) {
    return VerifyLandmarks(view, view, SceneRig(Sensor::kStereo), LoopDetectorOptions());
  };
  EXPECT_TRUE(verified(wide).accepted);
  EXPECT_GE(verified(spot).inliers, 35);
  EXPECT_FALSE(verified(spot).accepted);
  EXPECT_FALSE(verified(spot).reason.empty());
}

TEST(LandmarkMatches, AnotherSceneOrAHandfulOfLandmarksIsNoLoopAndSaysWhy) {
  const KeyframeView candidate = ViewOf(1, Pose(), 40);
  for (const KeyframeView& query : {ViewOf(2, Pose(), 40), ViewOf(1, Pose(), 8)}) {
    const Verification found =
        VerifyLandmarks(candidate, query, SceneRig(Sensor::kStereo), LoopDetectorOptions());
    EXPECT_FALSE(found.accepted);
    EXPECT_FALSE(found.reason.empty());
  }
}

}  // namespace
}  // namespace tutti
