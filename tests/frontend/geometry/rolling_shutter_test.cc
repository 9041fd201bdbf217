#include "frontend/geometry/rolling_shutter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
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

// A slanted wall, n p = 2 in the camera at the middle row's time, of which each row of depth was read 15 ms
// before that of colour.
TEST(RollingShutterTest, DepthIsLookedUpWhereAFeatureWasWhenDepthWasTaken) {
  const RollingScene scene(0.01);
  const Eigen::Vector3d normal(0.4, -0.3, 1);
  const auto depth_of = [&](const Eigen::Vector2d& pixel, const Pose& T_now_middle) {
    const Eigen::Vector3d ray = T_now_middle.Inverse().rotation * scene.rig.camera.Unproject(pixel);
    return (2 - normal.dot(T_now_middle.Inverse().translation)) / normal.dot(ray);
  };
  auto depth = std::make_shared<DepthImage>();
  depth->metres.create(scene.rig.camera.height, scene.rig.camera.width, CV_32FC1);
  depth->later_s = -0.015;
  depth->inverse_sigma = 0.003;
  for (int v = 0; v < depth->metres.rows; ++v) {
    const Pose taken = ExpSE3(scene.motion * (depth->later_s + scene.shutter.TimeOf(v)));
    for (int u = 0; u < depth->metres.cols; ++u)
      depth->metres.at<float>(v, u) = static_cast<float>(depth_of({u, v}, taken));
  }
  FrameFeatures seen = scene.Features();
  seen.inverse_depth_sigma.resize(seen.size());
  std::size_t known = 0;
  float least_sure = 0;
  double off_as_it_comes = 0;
  for (std::size_t f = 0; f < seen.size(); ++f) {
    const cv::Point2f& k = seen.keypoints[f].pt;
    seen.inverse_depth[f] =
        depth->InverseAt(static_cast<int>(std::lround(k.x)), static_cast<int>(std::lround(k.y)));
    off_as_it_comes =
        std::max(off_as_it_comes,
                 std::abs(double(seen.inverse_depth[f]) -
                          1 / depth_of({k.x, k.y}, ExpSE3(scene.motion * scene.shutter.TimeOf(k.y)))));
  }
  EXPECT_GT(off_as_it_comes, 0.01);
  seen.depth_image = depth;
  const auto straight = scene.shutter.Straighten(seen, scene.motion, 2);
  EXPECT_FALSE(straight->depth_image);
  for (std::size_t f = 0; f < seen.size(); ++f) {
    if (straight->inverse_depth[f] == 0) continue;  // it was beside the image then
    ++known;
    const cv::Point2f& k = straight->keypoints[f].pt;
    EXPECT_NEAR(straight->inverse_depth[f], 1 / depth_of({k.x, k.y}, Pose()), 0.002) << f;
    least_sure = std::max(least_sure, straight->inverse_depth_sigma[f]);
  }
  EXPECT_GT(known, seen.size() / 2);
  EXPECT_GT(least_sure, 0.0032F) << "the time of depth is not known for sure";
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
  rig.depth_delay_s = 0.01;
  EXPECT_TRUE(RollingShutter(rig).Rolls()) << "depth is of another time";
  EXPECT_NEAR(RollingShutter(RollingRig()).TimeOf(0), -0.015, 1e-12);
  EXPECT_NEAR(RollingShutter(RollingRig()).TimeOf(300), 0.015, 1e-12);
}

}  // namespace
}  // namespace tutti
