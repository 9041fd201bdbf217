// What an IMU does for the odometry.
#include <gtest/gtest.h>

#include <limits>

#include "core/numbers.h"
#include "tests/frontend/odometry/odometry_rider.h"
#include "tests/support/small_room.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::SectionsOf;
using testing::WithoutTimes;

constexpr std::size_t kWalk = 76, kCovered = 62, kUncovered = 69;
const Eigen::Quaterniond kImuMounting = ExpSO3({0.2, 0.5, -1.2});

// A shaken walk with 200 measurements a second, of an IMU that is mounted at an angle.
const testing::Recording& Walk() {
  static const testing::Recording walk = [] {
    SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
    options.shake_deg_per_s = 60;
    const testing::RenderedWorld world(options);
    testing::Recording recording = testing::Record(world, kWalk);
    const double h = 1e-4;
    int next = 0;
    for (InputFrame& frame : recording.frames) {
      for (; next * 0.005 <= frame.stamp_s + 0.02; ++next) {
        const double t = next * 0.005;
        const Eigen::Quaterniond before = world.World().PoseAt(t - h).rotation,
                                 after = world.World().PoseAt(t + h).rotation;
        ImuSample sample;
        sample.stamp_s = t;
        sample.gyro = kImuMounting.conjugate() * (LogSO3(before.conjugate() * after) / (2 * h)) +
                      Eigen::Vector3d(0.01, -0.02, 0.03);
        sample.acceleration = Eigen::Vector3d(0, 0, 9.81);
        frame.imu.push_back(sample);
      }
    }
    return recording;
  }();
  return walk;
}

TEST(ImuOdometry, MeasuresTheMountingAndCarriesTheRotationThroughACoveredLens) {
  const testing::Recording& walk = Walk();
  Odometry odometry(OdometryOptions(), walk.rig);
  for (std::size_t i = 0; i < kWalk; ++i) {
    const bool covered = i >= kCovered && i < kUncovered;
    InputFrame frame = covered ? testing::Black(walk.frames[i]) : walk.frames[i];
    frame.imu = walk.frames[i].imu;
    const TrackResult result = odometry.Track(frame);
    EXPECT_TRUE(covered || result.state == TrackingState::kTracking) << i;
  }
  const std::optional<ImuReport> imu = odometry.Report().imu;
  ASSERT_TRUE(imu);
  EXPECT_TRUE(imu->trusted);
  EXPECT_TRUE(imu->findings.empty());
  ASSERT_TRUE(imu->R_camera_imu);
  EXPECT_LT(imu->R_camera_imu->angularDistance(kImuMounting) * internal::kDegrees, 1);
  EXPECT_NEAR(imu->time_offset_s, 0, 0.004);
  EXPECT_EQ(odometry.map().NextPiece(), 1);
}

TEST(ImuOdometry, GoesOnFromItsStateToTheSameBytes) {
  const testing::Recording& walk = Walk();
  Odometry odometry(OdometryOptions(), walk.rig);
  for (std::size_t i = 0; i < 60; ++i) odometry.Track(walk.frames[i]);
  const auto file = testing::FreshFolder() / "state";
  testing::WriteSections(file, SectionsOf(odometry));
  Odometry again(OdometryOptions(), walk.rig);
  testing::LoadOdometry(file, &again);
  for (std::size_t i = 60; i < 66; ++i) {
    odometry.Track(walk.frames[i]);
    again.Track(walk.frames[i]);
  }
  testing::ExpectEqual(WithoutTimes(SectionsOf(odometry)), WithoutTimes(SectionsOf(again)));
}

TEST(ImuOdometry, RefusesMeasurementsThatAreNotFinite) {
  const testing::Recording& walk = Walk();
  Odometry odometry(OdometryOptions(), walk.rig);
  InputFrame frame = walk.frames[0];
  frame.imu[3].gyro.y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(odometry.Track(frame), InputError);
}

}  // namespace
}  // namespace tutti
