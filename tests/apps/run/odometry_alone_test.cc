#include "apps/run/odometry_alone.h"

#include <gtest/gtest.h>

#include <optional>

#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

constexpr std::size_t kFrames = 40, kCopiedAfter = 15;

class OdometryAloneTest : public ::testing::TestWithParam<bool> {
 protected:
  OdometryAloneTest() {
    const testing::RenderedWorld world(testing::SmallStereoTown(320, 160));
    recording_ = testing::Record(world, kFrames);
    options_.features = 500;
    odometry_.emplace(options_, recording_.rig);
    for (std::size_t i = 0; i < kCopiedAfter; ++i) odometry_->Track(recording_.frames[i]);
    last_ = recording_.frames[kCopiedAfter - 1].index;
  }

  testing::Recording recording_;
  OdometryOptions options_;
  std::optional<Odometry> odometry_;
  std::int64_t last_ = -1;
};

void ExpectSame(const Trajectory& a, const Trajectory& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].pose.Matrix(), b[i].pose.Matrix()) << i;
}

TEST_P(OdometryAloneTest, GoesOnAsTheOdometryItIsACopyOf) {
  OdometryAlone alone(*odometry_, last_, GetParam());
  for (const InputFrame& frame : recording_.frames) alone.Track(frame);  // it has seen some of them
  for (std::size_t i = kCopiedAfter; i < kFrames; ++i) odometry_->Track(recording_.frames[i]);
  alone.Finish();
  odometry_->FinishMapping();
  ExpectSame(FrameTrajectory(alone.Tracked().map()), FrameTrajectory(odometry_->map()));
  EXPECT_EQ(alone.last(), recording_.frames.back().index);
  EXPECT_GT(alone.CpuSeconds(), 0);
}

TEST_P(OdometryAloneTest, IsUpToDateWheneverItIsAsked) {
  OdometryAlone alone(*odometry_, last_, GetParam());
  for (std::size_t i = kCopiedAfter; i < kCopiedAfter + 6; ++i) {
    alone.Track(recording_.frames[i]);
    odometry_->Track(recording_.frames[i]);
    EXPECT_EQ(FrameTrajectory(alone.Tracked().map()).size(), FrameTrajectory(odometry_->map()).size());
  }
}

TEST_P(OdometryAloneTest, MayEndWhileFramesWait) {
  OdometryAlone alone(*odometry_, last_, GetParam());
  for (std::size_t i = kCopiedAfter; i < kFrames; ++i) alone.Track(recording_.frames[i]);
  EXPECT_EQ(alone.last(), recording_.frames.back().index);
}

INSTANTIATE_TEST_SUITE_P(OdometryAlone, OdometryAloneTest, ::testing::Bool(), [](const auto& tested) {
  return tested.param ? "OnAThreadOfItsOwn" : "WithinTrack";
});

}  // namespace
}  // namespace tutti
