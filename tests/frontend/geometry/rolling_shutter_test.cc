#include "frontend/geometry/rolling_shutter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/frontend/geometry/rolling_scene.h"

namespace tutti {
namespace {
using testing::RollingRig, testing::RollingScene;

TEST(RollingShutterTest, StraightenedFeaturesAreWhereTheMiddleRowsTimeSawThem) {
  const RollingScene scene(0.01);
  ASSERT_GT(scene.seen.size(), 60U);
  const FrameFeatures seen = scene.Features();
  const auto straight = scene.shutter.Straighten(seen, scene.motion, 2);
  double most = 0;
  for (std::size_t f = 0; f < seen.size(); ++f) {
    const Eigen::Vector3d p = scene.T_camera_world * scene.points[f];
    const Eigen::Vector2d truth = scene.rig.camera.Project(p);
    const cv::Point2f& k = straight->keypoints[f].pt;
    EXPECT_LT((Eigen::Vector2d(k.x, k.y) - truth).norm(), 1e-3) << f;
    EXPECT_NEAR(straight->inverse_depth[f], 1 / p.z(), 1e-5) << f;
    EXPECT_LT((Eigen::Vector2d(k.x, k.y) - straight->Rolled(f) - scene.seen[f].pixel).norm(), 1e-3);
    most = std::max(most, straight->Rolled(f).norm());
  }
  EXPECT_GT(most, 10);
}

TEST(RollingShutterTest, TheRowsTellHowTheCameraMoves) {
  const RollingScene scene(0.01);
  Pose pose(ExpSO3({0.12, -0.22, 0.04}), {0.25, 0.05, -0.1});
  Vector6d motion;
  MotionPrior prior;
  prior.sigma << Eigen::Vector3d::Constant(5), Eigen::Vector3d::Constant(10);
  std::vector<char> inlier;
  const int inliers = scene.shutter.Refine(scene.seen, prior, &pose, &motion, &inlier);
  EXPECT_EQ(inliers, static_cast<int>(scene.seen.size()));
  EXPECT_LT((motion - scene.motion).norm(), 0.02);
  EXPECT_LT(LogSE3(pose * scene.T_camera_world.Inverse()).norm(), 1e-3);
}

TEST(RollingShutterTest, TheStepFromTheLastFrameTellsTheMotionThatFewPointsDoNot) {
  RollingScene scene(0);
  scene.seen.resize(8);
  MotionPrior prior;
  prior.since_s = 1.0 / 30;
  prior.motion_before = scene.motion;
  prior.T_camera_world_before = ExpSE3(scene.motion * -prior.since_s) * scene.T_camera_world;
  prior.mean_sigma.setConstant(0.01);
  prior.sigma.setConstant(20);
  Pose pose = scene.T_camera_world;
  Vector6d motion;
  std::vector<char> inlier;
  scene.shutter.Refine(scene.seen, prior, &pose, &motion, &inlier);
  EXPECT_LT((motion - scene.motion).norm(), 0.05);
  EXPECT_LT(LogSE3(pose * scene.T_camera_world.Inverse()).norm(), 2e-3);
}

TEST(RollingShutterTest, WrongMatchesAreOutliers) {
  RollingScene scene(0);
  for (std::size_t i = 0; i < scene.seen.size(); i += 5) scene.seen[i].pixel.x() += 25;
  Pose pose = scene.T_camera_world;
  Vector6d motion;
  std::vector<char> inlier;
  MotionPrior prior;
  prior.sigma.setConstant(3);
  scene.shutter.Refine(scene.seen, prior, &pose, &motion, &inlier);
  for (std::size_t i = 0; i < scene.seen.size(); ++i) EXPECT_EQ(inlier[i], i % 5 == 0 ? 0 : 1) << i;
  EXPECT_LT((motion - scene.motion).tail<3>().norm(), 0.05);
}

TEST(RollingShutterTest, AGlobalShutterDoesNotRoll) {
  CameraRig rig = RollingRig();
  rig.readout_s = 0;
  EXPECT_FALSE(RollingShutter(rig).Rolls());
  EXPECT_TRUE(RollingShutter(RollingRig()).Rolls());
  EXPECT_NEAR(RollingShutter(RollingRig()).TimeOf(0), -0.015, 1e-12);
  EXPECT_NEAR(RollingShutter(RollingRig()).TimeOf(300), 0.015, 1e-12);
}

}  // namespace
}  // namespace tutti
