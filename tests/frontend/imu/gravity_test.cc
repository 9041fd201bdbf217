#include "frontend/imu/gravity.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/numbers.h"
#include "core/state_archive.h"

namespace tutti {
namespace {

const Eigen::Quaterniond kImuOnCamera = ExpSO3({-0.4, 1.2, 0.5});  // R_camera_imu
const Eigen::Quaterniond kMapTilt = ExpSO3({1.9, -0.2, 0.4});  // axes of the map, from those with z upwards
const Eigen::Vector3d kAccelerationBias(0.15, -0.1, 0.2);

// A body that swings and turns about all axes; z upwards.
Pose FlownAt(double t) {
  return Pose(ExpSO3({0, 0, 0.4 * t}) * ExpSO3({0.5 * std::sin(0.9 * t), 0.3 * std::sin(0.7 * t), 0}),
              Eigen::Vector3d(2 * std::sin(0.8 * t), 1.5 * std::cos(0.6 * t), 0.5 * std::sin(1.3 * t)));
}

ImuSample FeltAt(double t) {
  const double h = 1e-3;
  ImuSample sample;
  sample.stamp_s = t;
  const Pose now = FlownAt(t);
  sample.gyro = LogSO3(FlownAt(t - h).rotation.conjugate() * FlownAt(t + h).rotation) / (2 * h);
  const Eigen::Vector3d acceleration =
      (FlownAt(t + h).translation - 2 * now.translation + FlownAt(t - h).translation) / (h * h);
  sample.acceleration =
      now.rotation.conjugate() * (acceleration + Eigen::Vector3d(0, 0, 9.81)) + kAccelerationBias;
  return sample;
}

struct Flown {
  Gravity gravity;
  ImuReport report;
  std::map<std::int64_t, Pose> T_world_camera;
};

// 20 frames a second, poses in a unit of the map's own.
Flown Fly(double seconds, double unit_m) {
  Flown flown;
  ImuExamination examination;
  const auto camera = [&](double t) {
    const Pose body = FlownAt(t);
    return Pose(kMapTilt * body.rotation * kImuOnCamera.conjugate(), kMapTilt * body.translation / unit_m);
  };
  std::vector<ImuSample> samples;
  int measured = 0;
  for (int frame = 0; frame * 0.05 < seconds; ++frame) {
    const double t = 1 + frame * 0.05;
    samples.clear();
    for (; measured * 0.005 <= t + 0.01; ++measured) samples.push_back(FeltAt(measured * 0.005));
    examination.Add(samples);
    flown.T_world_camera[frame] = camera(t);
    flown.gravity.AddFrame(frame, t);
    if (frame > 0)
      examination.AddStep(t - 0.05, t, camera(t - 0.05).rotation.conjugate() * camera(t).rotation);
    flown.gravity.Take(examination);
  }
  examination.Examine();
  flown.gravity.Take(examination);
  flown.report = examination.report();
  return flown;
}

double Off_deg(const Eigen::Vector3d& up) {
  return std::acos(std::min(1.0, up.dot(kMapTilt * Eigen::Vector3d::UnitZ()))) * internal::kDegrees;
}

TEST(Gravity, UpAndBiasAreFoundWhileTheBodySwings) {
  const Flown flown = Fly(30, 1);
  ImuReport report = flown.report;
  ASSERT_TRUE(report.trusted);
  flown.gravity.Find(flown.T_world_camera, true, &report);
  ASSERT_TRUE(report.up);
  EXPECT_LT(Off_deg(*report.up), 0.1);
  EXPECT_LT(report.up_sigma_deg, 0.5);
  EXPECT_NEAR(report.gravity_mps2, 9.81, 0.03);
  EXPECT_LT((report.acceleration_bias - kAccelerationBias).norm(), 0.03);
}

TEST(Gravity, OneCamerasMapNeedsNoMetres) {
  const Flown flown = Fly(30, 7.3);
  ImuReport report = flown.report;
  flown.gravity.Find(flown.T_world_camera, false, &report);
  ASSERT_TRUE(report.up);
  EXPECT_LT(Off_deg(*report.up), 0.1);
  EXPECT_NEAR(report.metres, 7.3, 0.01 * 7.3);
  EXPECT_LT(report.metres_sigma, 0.02);
  EXPECT_GT(report.metres_sigma, std::abs(report.metres / 7.3 - 1) / 4);
}

TEST(Gravity, EachWindowSaysWhereUpIs) {
  const Flown flown = Fly(30, 1);
  ImuReport report = flown.report;
  flown.gravity.Find(flown.T_world_camera, true, &report);
  EXPECT_GE(report.tilts.size(), 12U);
  EXPECT_EQ(report.metres, 0) << "of a metric map it is not asked";
  for (const ImuTilt& tilt : report.tilts) {
    EXPECT_LT(Off_deg(tilt.up), 1);
    EXPECT_NEAR(tilt.stamp_s, 1 + 0.05 * static_cast<double>(tilt.frame), 1e-6);
  }
}

TEST(Gravity, AMapInTheWrongUnitDoesNotTiltTheWorldUnsaid) {
  const Flown flown = Fly(30, 7.3);
  ImuReport report = flown.report;
  flown.gravity.Find(flown.T_world_camera, true, &report);
  if (report.up) {
    EXPECT_LT(Off_deg(*report.up), 5 * report.up_sigma_deg);
  }
}

TEST(Gravity, FramesWithoutAPoseBeginAnotherWindow) {
  Flown flown = Fly(40, 1);
  for (std::int64_t frame = 0; frame < 800; frame += 97) flown.T_world_camera.erase(frame);
  ImuReport report = flown.report;
  flown.gravity.Find(flown.T_world_camera, true, &report);
  ASSERT_TRUE(report.up);
  EXPECT_LT(Off_deg(*report.up), 0.2);
}

TEST(Gravity, ShortRunsAndUntrustedImusSayNothing) {
  const Flown flown = Fly(30, 1);
  ImuReport report = flown.report;
  std::map<std::int64_t, Pose> few(flown.T_world_camera.begin(), std::next(flown.T_world_camera.begin(), 60));
  flown.gravity.Find(few, true, &report);
  EXPECT_FALSE(report.up);
  report.trusted = false;
  flown.gravity.Find(flown.T_world_camera, true, &report);
  EXPECT_FALSE(report.up);
}

TEST(Gravity, ASavedOneGoesOn) {
  const Flown flown = Fly(30, 1);
  Gravity read;
  internal::ReadStateBytes(internal::StateBytes(flown.gravity), "test", read);
  ImuReport report = flown.report, again = flown.report;
  flown.gravity.Find(flown.T_world_camera, true, &report);
  read.Find(flown.T_world_camera, true, &again);
  ASSERT_TRUE(report.up && again.up);
  EXPECT_EQ(*report.up, *again.up);
  EXPECT_TRUE(read.IsPossible());
}

}  // namespace
}  // namespace tutti
