#include "frontend/odometry/mono_initializer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;
using testing::Moved;

class MonoInitializerTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  // Offers a first view and, 0.1 s later, one that has moved so far to the side.
  bool Start(double sideways, const OdometryOptions& options = OdometryOptions()) {
    MonoInitializer initializer(options, Rig());
    map_made_ = Map(PyramidScales(options));
    reason_.clear();
    EXPECT_FALSE(initializer.Offer(Frame(Pose(), 0), 0, Pose(), 1, &map_made_, &reason_));
    return initializer.Offer(Frame(Moved(sideways, 0, 0.02), 0.1), 0, Pose(), 1, &map_made_, &reason_);
  }

  Map map_made_{PyramidScales(OdometryOptions())};
  std::string reason_;
};

TEST_F(MonoInitializerTest, StartsFromTwoViewsThatAreFarApart) {
  ASSERT_TRUE(Start(0.6)) << reason_;
  ASSERT_EQ(map_made_.KeyframeCount(), 2);
  const Pose T_first_second = map_made_.keyframe(1).T_world_camera;
  EXPECT_GT(T_first_second.translation.normalized().x(), 0.9999);
  EXPECT_NEAR(LogSO3(T_first_second.rotation).y(), 0.02, 1e-4);
  EXPECT_NEAR(map_made_.MedianDepth(0), 1, 0.02);
  EXPECT_GT(map_made_.LandmarkCount(), 100);
}

TEST_F(MonoInitializerTest, WaitsWhileATurnAndASidewaysStepLookTheSame) {
  EXPECT_FALSE(Start(0.14));
  EXPECT_THAT(reason_, HasSubstr("the direction of motion is known to"));
  EXPECT_EQ(map_made_.KeyframeCount(), 0);
  EXPECT_EQ(map_made_.LandmarkCount(), 0);
  OdometryOptions bold;  // there is parallax enough, and nothing else that speaks against this pair
  bold.max_direction_sigma_deg = 90;
  EXPECT_TRUE(Start(0.14, bold)) << reason_;
}

// The camera turns by 6 deg a frame while it moves: the first view is soon out of sight.
TEST_F(MonoInitializerTest, AYoungerViewTakesThePlaceOfOneThatIsOutOfSight) {
  MonoInitializer initializer(OdometryOptions(), Rig());
  Map map(PyramidScales(OdometryOptions()));
  EXPECT_FALSE(initializer.Offer(Frame(Moved(0, 0, 0.5), 0), 0, Pose(), 1, &map, &reason_));
  EXPECT_FALSE(initializer.Offer(Frame(Moved(0.02, 0, 0.1), 0.3), 0, Pose(), 1, &map, &reason_));
  EXPECT_FALSE(initializer.Offer(Frame(Moved(0.04, 0, 0.08), 0.6), 0, Pose(), 1, &map, &reason_));
  EXPECT_TRUE(initializer.Offer(Frame(Moved(0.6, 0, -0.5), 0.9), 0, Pose(), 1, &map, &reason_)) << reason_;
  EXPECT_NEAR(map.keyframe(0).stamp_s, 0.3, 1e-9);
}

TEST_F(MonoInitializerTest, KeepsTheFramesThatWait) {
  MonoInitializer initializer(OdometryOptions(), Rig());
  Map map(PyramidScales(OdometryOptions()));
  for (int i = 0; i < 3; ++i)
    EXPECT_FALSE(initializer.Offer(Frame(Moved(0.05 * i, 0), 0.1 * i), 0, Pose(), 1, &map, &reason_));
  EXPECT_EQ(initializer.pending().size(), 3);
  EXPECT_TRUE(initializer.Offer(Frame(Moved(0.6, 0), 0.3), 0, Pose(), 1, &map, &reason_)) << reason_;
}

}  // namespace
}  // namespace tutti
