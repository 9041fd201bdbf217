#include "frontend/odometry/relocalizer.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

using testing::Distance;
using testing::Moved;

class RelocalizerTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  Relocalizer relocalizer_{OdometryOptions(), Rig()};  // gives up after 0.5 s
};

TEST_F(RelocalizerTest, FindsTheLostFrameAtAKeyframe) {
  const Pose T_world_camera = Moved(0.3, 0, 0.4);
  relocalizer_.Lose(Frame(T_world_camera, 1));
  EXPECT_TRUE(relocalizer_.HasFrame());
  const auto fix = relocalizer_.FindAt(0, map_);
  ASSERT_TRUE(fix);
  EXPECT_LT(Distance(fix->T_camera_world, T_world_camera.Inverse()), 1e-5);
}

TEST_F(RelocalizerTest, AFrameThatWaitsForAMapCanBeFoundInAnOlderOne) {
  relocalizer_.Wait(Frame(Moved(0.3, 0), 1));
  EXPECT_TRUE(relocalizer_.FindAt(0, map_));
}

TEST_F(RelocalizerTest, WithNothingLostThereIsNothingToFind) {
  EXPECT_FALSE(relocalizer_.HasFrame());
  EXPECT_FALSE(relocalizer_.FindAt(0, map_));
  relocalizer_.Lose(Frame(Pose(), 1));
  relocalizer_.Found();
  EXPECT_FALSE(relocalizer_.HasFrame());
  EXPECT_FALSE(relocalizer_.FindAt(0, map_));
}

TEST_F(RelocalizerTest, ALostFrameWithNothingToLookUpStaysLost) {
  relocalizer_.Lose(Frame(Pose(), 1));
  EXPECT_FALSE(relocalizer_.FindAt(0, Map(PyramidScales(OdometryOptions()))));
  for (const int no_such : {-1, 1, 1000000}) EXPECT_FALSE(relocalizer_.FindAt(no_such, map_)) << no_such;
  relocalizer_.Lose(Nothing(1.1));
  EXPECT_FALSE(relocalizer_.FindAt(0, map_));
  relocalizer_.Lose(Elsewhere(1.2));
  EXPECT_FALSE(relocalizer_.FindAt(0, map_));
  EXPECT_TRUE(relocalizer_.HasFrame()) << "another keyframe may show it";
}

TEST_F(RelocalizerTest, TheNewestLostFrameIsTheOneThatIsLookedFor) {
  relocalizer_.Lose(Elsewhere(1));
  relocalizer_.Lose(Frame(Pose(), 1.1));
  EXPECT_TRUE(relocalizer_.FindAt(0, map_));
}

TEST_F(RelocalizerTest, KeepsTheLostFramesInTheirOrderUntilTheyAreTaken) {
  relocalizer_.Lose(Elsewhere(1));
  relocalizer_.Lose(Nothing(1.1));
  relocalizer_.Wait(Elsewhere(1.2));
  relocalizer_.Found();
  EXPECT_EQ(relocalizer_.Lost().size(), 3u);
  const std::vector<TrackedFrame> lost = relocalizer_.TakeLost();
  ASSERT_EQ(lost.size(), 3u);
  EXPECT_EQ(lost.front().stamp_s, 1);
  EXPECT_EQ(lost.back().stamp_s, 1.2);
  EXPECT_TRUE(relocalizer_.TakeLost().empty());
  for (int i = 0; i < 300; ++i) relocalizer_.Lose(Nothing(0.1 * i));
  EXPECT_LE(relocalizer_.Lost().size(), 100u);
  EXPECT_NEAR(relocalizer_.Lost().back().stamp_s, 29.9, 1e-9);
}

TEST_F(RelocalizerTest, GivesUpWhenNothingOfTheMapWasInViewForTooLong) {
  EXPECT_FALSE(relocalizer_.Lose(Elsewhere(10)));
  EXPECT_FALSE(relocalizer_.Lose(Elsewhere(10.5)));
  EXPECT_TRUE(relocalizer_.Lose(Elsewhere(10.6)));
  EXPECT_FALSE(relocalizer_.Lose(Elsewhere(10.7))) << "it counts from the start again";
  EXPECT_FALSE(relocalizer_.Lose(Elsewhere(11)));
  relocalizer_.Found();
  EXPECT_FALSE(relocalizer_.Lose(Elsewhere(11.4)));
}

TEST_F(RelocalizerTest, ACoveredLensNeverGivesUp) {
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(relocalizer_.Lose(Nothing(i)));
  EXPECT_FALSE(relocalizer_.Lose(Elsewhere(50))) << "the clock starts here";
  EXPECT_FALSE(relocalizer_.Lose(Nothing(60)));
  EXPECT_TRUE(relocalizer_.Lose(Elsewhere(61)));
}

TEST_F(RelocalizerTest, AStampThatIsNoNumberOrGoesBackDoesNotStopTheClockForGood) {
  for (const double stamp_s : {std::numeric_limits<double>::quiet_NaN(), 100.0}) {
    Relocalizer relocalizer = relocalizer_;
    EXPECT_FALSE(relocalizer.Lose(Elsewhere(1)));
    TrackedFrame odd = Elsewhere(1);
    odd.stamp_s = stamp_s;
    relocalizer.Lose(odd);
    EXPECT_FALSE(relocalizer.Lose(Elsewhere(2)));
    EXPECT_TRUE(relocalizer.Lose(Elsewhere(3))) << stamp_s;
  }
}

}  // namespace
}  // namespace tutti
