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
const testing::Recording& Walk() {
  static const testing::Recording room = [] {
    SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
    options.rate_hz = 8;
    options.frames = 60;
    return testing::Record(testing::RenderedWorld(options), 60);
  }();
  return room;
}

Odometry Tracked(double focal_share) { return Tracked(Walk(), focal_share); }

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

TEST(MapFigures, LocalScaleIsThatOfTheMapAgainstMeasuredDepths) {
  Odometry odometry = Tracked(1);
  EXPECT_NEAR(MeasureMap(odometry, {}).local_scale, 1, 0.01);
  MapCorrection larger;
  for (const int id : odometry.map().KeyframeIds()) {
    Similarity S_world_keyframe(odometry.map().keyframe(id).T_world_camera);
    S_world_keyframe.translation *= 1.1;
    S_world_keyframe.scale = 1.1;
    larger.S_world_keyframe.emplace(id, S_world_keyframe);
  }
  odometry.Correct(larger);
  EXPECT_NEAR(MeasureMap(odometry, {}).local_scale, 1.1, 0.01);
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

TEST(LensCheck, SigmaIsThatOfTheScatterOverFirstFrames) {
  double sum = 0;
  int runs = 0;
  for (std::size_t first = 0; first + 36 <= Walk().frames.size(); first += 4) {
    testing::Recording part = Walk();
    part.frames = {Walk().frames.begin() + static_cast<std::ptrdiff_t>(first),
                   Walk().frames.begin() + static_cast<std::ptrdiff_t>(first + 36)};
    const LensCheck check = CheckLens(Tracked(part, 1));
    if (!check.measured) continue;  // too few keyframes
    EXPECT_LT(check.sigma, 0.012) << first;
    sum += std::pow(std::log(check.focal_ratio) / check.sigma, 2);
    ++runs;
  }
  EXPECT_GE(runs, 3);
  EXPECT_LT(sum / runs, 2);
}

// Along a straight road a stereo camera sees the same world with every focal length.
TEST(LensCheck, OfStereoStraightAheadIsUncertain) {
  SyntheticOptions options = testing::SmallStereoTown(320, 160);
  options.block_m = 200;
  const testing::Recording road = testing::Record(testing::RenderedWorld(options), 45);
  for (const double share : {1.0, 1.3}) EXPECT_GT(CheckLens(Tracked(road, share)).sigma, 0.05) << share;
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
