#include "frontend/geometry/ground_plane.h"

#include <gtest/gtest.h>

#include <cmath>

#include "data/synthetic/synthetic_world.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

constexpr double kHeight = 1.65;  // of the generated town's camera [m]

// Two views from a car.
class GroundPlaneTest : public ::testing::Test {
 protected:
  GroundPlaneTest() : world_(testing::SmallStereoTown(640, 320)) {
    first_ = world_.Render(20).image;
    second_ = world_.Render(21).image;
    T_second_first_ = world_.PoseOf(21).Inverse() * world_.PoseOf(20);
  }
  std::optional<GroundPlane> Align(double start_height) const {
    return AlignGround(world_.Camera(), first_, second_, T_second_first_, {0, 1 / start_height, 0});
  }

  SyntheticWorld world_;
  cv::Mat first_, second_;
  Pose T_second_first_;
};

TEST_F(GroundPlaneTest, TellsHowHighTheCameraIs) {
  const auto found = Align(1.03 * kHeight);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->Height(), kHeight, 0.03 * kHeight);
  EXPECT_GT(found->correlation, 0.85);
  EXPECT_LT(std::acos(found->normal_by_height.normalized().y()), 0.08);
}

TEST_F(GroundPlaneTest, IsFoundWhereTheHeightIsNotKnown) {
  const auto about = SearchGround(world_.Camera(), first_, second_, T_second_first_);
  ASSERT_TRUE(about);
  const auto found = AlignGround(world_.Camera(), first_, second_, T_second_first_, about->normal_by_height);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->Height(), kHeight, 0.05 * kHeight);
}

TEST_F(GroundPlaneTest, HasTheUnitOfTheWayBetweenTheViews) {
  T_second_first_.translation *= 0.5;
  const auto found = Align(0.5 * 1.03 * kHeight);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->Height(), 0.5 * kHeight, 0.015 * kHeight);
}

TEST_F(GroundPlaneTest, DoesNotMindOtherBrightness) {
  const auto before = Align(kHeight);
  second_.convertTo(second_, -1, 0.7, 20);
  const auto found = Align(kHeight);
  ASSERT_TRUE(before && found);
  EXPECT_NEAR(found->Height(), before->Height(), 0.01 * kHeight);
}

TEST_F(GroundPlaneTest, IsNotFoundWithoutContrastOrWithoutAWay) {
  const Pose T = T_second_first_;
  T_second_first_.translation.setZero();
  EXPECT_FALSE(SearchGround(world_.Camera(), first_, second_, T_second_first_));
  T_second_first_ = T;
  first_.setTo(100);
  second_.setTo(100);
  const auto found = SearchGround(world_.Camera(), first_, second_, T_second_first_);
  EXPECT_FALSE(found && found->correlation > 0);
  EXPECT_FALSE(Align(kHeight));
}

TEST_F(GroundPlaneTest, IsNoneWhereItWouldBeOutsideTheImage) {
  EXPECT_FALSE(AlignGround(world_.Camera(), first_, second_, T_second_first_, {0, -1 / kHeight, 0}));
}

}  // namespace
}  // namespace tutti
