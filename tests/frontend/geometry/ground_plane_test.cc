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

// A robot's camera may look at the floor before it, or a dash camera up. Not every pair of images tells the
// ground; some of these must.
TEST_F(GroundPlaneTest, IsFoundByACameraThatLooksDownOrUp) {
  for (const double degrees : {25.0, 15.0, -8.0}) {
    const Pose T_level_pitched(
        Eigen::Quaterniond(Eigen::AngleAxisd(-degrees * M_PI / 180, Eigen::Vector3d::UnitX())),
        Eigen::Vector3d::Zero());
    int found_in = 0;
    for (const std::size_t i : {20, 30, 40}) {
      const Pose first = world_.PoseOf(i) * T_level_pitched, second = world_.PoseOf(i + 1) * T_level_pitched;
      first_ = world_.RenderFrom(i, first).image;
      second_ = world_.RenderFrom(i + 1, second).image;
      const Pose T = second.Inverse() * first;
      const auto about = SearchGround(world_.Camera(), first_, second_, T);
      if (!about) continue;
      const auto found = AlignGround(world_.Camera(), first_, second_, T, about->normal_by_height);
      if (!found) continue;
      ++found_in;
      EXPECT_NEAR(found->Height(), kHeight, 0.05 * kHeight) << degrees << " " << i;
      EXPECT_NEAR(std::asin(found->normal_by_height.normalized().z()), degrees * M_PI / 180, 0.08) << i;
    }
    EXPECT_GE(found_in, 2) << degrees;
  }
}

TEST_F(GroundPlaneTest, IsRightBelowWhereTheWayIsLevel) {
  const auto along_z = NormalBelow(Pose(Eigen::Quaterniond::Identity(), {0, 0, -1}));
  ASSERT_TRUE(along_z);
  EXPECT_LT((*along_z - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  const auto uphill = NormalBelow(Pose(Eigen::Quaterniond::Identity(), {0, 0.1, -1}));  // it moves to -y
  ASSERT_TRUE(uphill);
  EXPECT_GT(uphill->z(), 0.09);
  EXPECT_FALSE(NormalBelow(Pose()));
  EXPECT_FALSE(NormalBelow(Pose(Eigen::Quaterniond::Identity(), {0, 1, 0}))) << "a lift";
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
