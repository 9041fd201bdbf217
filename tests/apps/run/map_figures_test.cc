// What the map of a walk around a room looks like, with the right camera and with a wrong one.
#include "apps/run/map_figures.h"

#include <gtest/gtest.h>

#include <cmath>

#include "apps/run/focal_length.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_room.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

// With a camera whose focal length is taken to be so many times what it is.
Odometry Tracked(const testing::Recording& recording, double focal_share) {
  CameraRig rig = recording.rig;
  rig.camera.fx *= focal_share;
  rig.camera.fy *= focal_share;
  Odometry odometry(OdometryOptions(), rig);
  for (const InputFrame& frame : recording.frames) odometry.Track(frame);
  odometry.FinishMapping();
  return odometry;
}

// A walk around a room.
Odometry Tracked(double focal_share) {
  SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
  options.rate_hz = 8;
  options.frames = 60;
  static const testing::Recording room = testing::Record(testing::RenderedWorld(options), 60);
  return Tracked(room, focal_share);
}

TEST(MapFigures, OfTheRightCameraFit) {
  const Odometry odometry = Tracked(1);
  const MapFigures figures = MeasureMap(odometry, {});
  EXPECT_EQ(figures.keyframes, static_cast<int>(odometry.map().KeyframeIds().size()));
  EXPECT_GT(figures.landmarks, 40);
  EXPECT_LT(figures.misfit_px, 1);
  EXPECT_GE(figures.scale_jump, 1);
  EXPECT_LT(figures.scale_jump, 2);
  ASSERT_EQ(figures.depth.size(), odometry.map().KeyframeIds().size());
  EXPECT_GT(figures.depth.begin()->second, 0.3);
  EXPECT_LT(figures.depth.begin()->second, 10);
}

TEST(MapFigures, LookAtTheFramesOfTheSessionAlone) {
  const Odometry odometry = Tracked(1);
  FrameRange none;
  none.first = 1000;
  EXPECT_EQ(MeasureMap(odometry, none).keyframes, 0);
  EXPECT_FALSE(CheckLens(odometry, none).measured);
}

TEST(LensCheck, FindsTheRightCameraRightAndAWrongOneWrong) {
  const LensCheck right = CheckLens(Tracked(1));
  ASSERT_TRUE(right.measured);
  EXPECT_NEAR(right.focal_ratio, 1, 0.04);
  const LensCheck wrong = CheckLens(Tracked(1.25));
  EXPECT_LT(wrong.focal_ratio, 0.92);
  EXPECT_EQ(CheckLens(Tracked(1.25)).focal_ratio, wrong.focal_ratio);
}

// Another lens explains a part of it as well, and would make the focal length uncertain.
TEST(LensCheck, OfStereoInTurnsTellsTheFocalLengthWithoutAnotherLens) {
  const testing::Recording lap =
      testing::Record(testing::RenderedWorld(testing::SmallStereoTownWithALoop(320, 160)), 45);
  for (const double share : {1.0, 1.25}) {
    const LensCheck check = CheckLens(Tracked(lap, share));
    ASSERT_TRUE(check.measured) << share;
    const double off = std::abs(std::log(check.focal_ratio));
    EXPECT_LT(std::abs(check.k1), 0.01) << share;
    if (share == 1.0) {
      EXPECT_LT(off, 2 * check.sigma);
    } else {
      EXPECT_GT(off, 2 * check.sigma + 0.02) << check.focal_ratio << " +- " << check.sigma;
    }
  }
}

}  // namespace
}  // namespace tutti
