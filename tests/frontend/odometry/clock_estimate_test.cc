#include "frontend/odometry/clock_estimate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "frontend/dataset/rectified_rig.h"
#include "frontend/odometry/depth_rotation.h"

namespace tutti {
namespace {

const PinholeCamera kDepthCamera = Pinhole(262, 262, 159.5, 119.5, {320, 240});
constexpr double kInverseSigma = 0.003;  // of inverse depth [1/m]

// What a camera sees of planes n x = d, in its world.
DepthGrid See(const std::vector<Eigen::Vector4d>& planes, const Pose& T_camera_world) {
  DepthGrid grid;
  grid.step = 8;
  grid.columns = 40;
  const Pose T_world_camera = T_camera_world.Inverse();
  for (int r = 0; r < 30; ++r) {
    for (int c = 0; c < 40; ++c) {
      const Eigen::Vector3d ray = T_world_camera.rotation * kDepthCamera.Unproject(grid.PixelOf(r, c));
      double nearest = 0;
      for (const Eigen::Vector4d& plane : planes) {
        const double z =
            (plane(3) - plane.head<3>().dot(T_world_camera.translation)) / plane.head<3>().dot(ray);
        if (z > 0.2 && (nearest == 0 || z < nearest)) nearest = z;
      }
      const double noise =
          0.2 * kInverseSigma * std::sin(12.9898 * (r * 40 + c) + 4.1 * T_camera_world.translation.x());
      grid.inverse_depth.push_back(nearest > 0 ? static_cast<float>(1 / nearest + noise) : 0.0F);
    }
  }
  return grid;
}

std::optional<DepthRotation> Between(const DepthGrid& first, const DepthGrid& second, const Pose& about) {
  CameraRig rig;
  rig.camera = kDepthCamera;
  const Vector6d rest = Vector6d::Zero();
  return RotationByDepth(RollingShutter(rig), {first, rest}, {second, rest}, about, kInverseSigma);
}

TEST(DepthRotation, OfACornerIsFoundToATenthOfADegree) {
  const std::vector<Eigen::Vector4d> corner = {
      {0, 0, 1, 3}, {1, 0, 0.3, 1.9}, {0, 1, 0.1, 1.1}, {0, -1, 0, 1.2}};
  const Pose first(ExpSO3({0.1, 0.05, 0.02}), {0.1, 0, 0}),
      step(ExpSO3({0.05, -0.08, 0.06}), {0.02, -0.01, 0.03});
  const auto found =
      Between(See(corner, first), See(corner, step * first), Pose(ExpSO3({0.045, -0.07, 0.055}), {0, 0, 0}));
  ASSERT_TRUE(found);
  EXPECT_LT((found->rotation_rad - LogSE3(step).tail<3>()).norm(), 0.0017);
}

TEST(DepthRotation, AboutTheNormalOfAWallIsUnknown) {
  const std::vector<Eigen::Vector4d> wall = {{0, 0, 1, 2}};
  const auto found = Between(See(wall, Pose()), See(wall, Pose()), Pose());
  ASSERT_TRUE(found);
  EXPECT_LT(found->information(2, 2), 1e-2 * found->information(0, 0));
  EXPECT_LT(found->information(2, 2), 1e-2 * found->information(1, 1));
  EXPECT_FALSE(Between(See({}, Pose()), See(wall, Pose()), Pose())) << "nothing is seen";
}

TEST(Measurements, AFewThatAreWildDoNotMoveTheMean) {
  Measurements all;
  EXPECT_TRUE(std::isinf(all.Mean().second)) << "of none";
  for (int k = 0; k < 40; ++k) all.Add(0.025 + 0.002 * std::sin(7.0 * k), 0.002);
  for (int k = 0; k < 4; ++k) all.Add(0.2, 0.002);
  const auto [mean, sigma] = all.Mean();
  EXPECT_NEAR(mean, 0.025, 0.0012);
  EXPECT_GT(sigma, 1e-4);
  EXPECT_LT(sigma, 1.5e-3);
}

TEST(ClockEstimate, IsOfDepthCamerasAlone) {
  CameraRig rig;
  rig.camera = kDepthCamera;
  EXPECT_FALSE(ClockEstimate(rig, {}).Found());
  rig.sensor = Sensor::kRgbd;
  const auto found = ClockEstimate(rig, {}).Found();
  ASSERT_TRUE(found);
  EXPECT_TRUE(std::isinf(found->readout_sigma_s)) << "it has not moved";
  EXPECT_TRUE(std::isinf(found->depth_delay_sigma_s));
}

}  // namespace
}  // namespace tutti
