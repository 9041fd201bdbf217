#include "frontend/geometry/rolling_shutter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tutti {
namespace {

CameraRig RollingRig() {
  CameraRig rig;
  rig.sensor = Sensor::kRgbd;
  rig.camera.width = 400;
  rig.camera.height = 301;
  rig.camera.fx = rig.camera.fy = 330;
  rig.camera.cx = 199.5;
  rig.camera.cy = 150;
  rig.readout_s = 0.03;
  return rig;
}

// What a moving camera sees of points: the pixel in whose row a point is when that row is read.
struct RollingScene {
  CameraRig rig = RollingRig();
  RollingShutter shutter{rig};
  Pose T_camera_world{ExpSO3({0.1, -0.2, 0.05}), {0.2, 0.1, -0.1}};
  Vector6d motion;
  std::vector<Eigen::Vector3d> points;  // in the world
  std::vector<PointObservation> seen;   // as the image has them

  explicit RollingScene(double depth_sigma) {
    motion << 0.5, -0.3, 0.2, 1.5, -2.5, 3.0;
    for (int i = 0; i < 150; ++i) {
      const Eigen::Vector3d p(1.6 * std::sin(1.3 * i), 1.2 * std::sin(2.1 * i + 1), 2.5 + std::sin(0.7 * i));
      Eigen::Vector2d pixel = rig.camera.Project(p);
      Eigen::Vector3d then = p;
      for (int k = 0; k < 20; ++k) {
        then = ExpSE3(motion * shutter.TimeOf(pixel.y())) * p;
        pixel = rig.camera.Project(then);
      }
      if (!rig.camera.Contains(pixel)) continue;
      points.push_back(T_camera_world.Inverse() * p);
      seen.push_back({points.back(), pixel, 1, 1 / then.z(), depth_sigma});
    }
  }
};

TEST(RollingShutterTest, StraightenedFeaturesAreWhereTheMiddleRowsTimeSawThem) {
  const RollingScene scene(0.01);
  ASSERT_GT(scene.seen.size(), 60U);
  FrameFeatures seen;
  for (const PointObservation& o : scene.seen) {
    seen.keypoints.emplace_back(static_cast<float>(o.pixel.x()), static_cast<float>(o.pixel.y()), 31.0F);
    seen.inverse_depth.push_back(static_cast<float>(o.inverse_depth));
  }
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
