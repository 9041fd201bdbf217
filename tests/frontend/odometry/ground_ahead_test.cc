#include "frontend/odometry/ground_ahead.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace tutti {
namespace {

constexpr double kEye = 1.65;  // [m]

// The last camera, seen from one that is so far ahead of it, to its right and below it.
Pose Step(double forward, double right = 0, double down = 0) {
  return {Eigen::Quaterniond::Identity(), -Eigen::Vector3d(right, down, forward)};
}

// A level ground below a camera that looks along it, `slope` steeper downwards ahead, through the point right
// below a camera that is `through` ahead.
Eigen::Vector3d Plane(double slope, double through) {
  const Eigen::Vector3d n(0, 1, -slope);  // n . X = kEye - slope * through
  return n / (kEye - slope * through);
}

// Heights that are told over a drive of 20 m straight on.
std::vector<double> DriveOver(GroundAhead* ahead, const Pose& step) {
  std::vector<double> heights;
  for (int i = 0; i < 40; ++i) {
    for (const GroundAhead::Height& height : ahead->Approach(step))
      heights.push_back(std::exp(height.log_height));
  }
  return heights;
}

TEST(GroundAhead, TellsTheHeightOnceTheCameraIsAboveIt) {
  GroundAhead ahead;
  ahead.Add(Plane(0, 0), Pose(), 0.5);
  EXPECT_TRUE(ahead.Approach(Step(2)).empty()) << "not there yet";
  const auto reached = ahead.Approach(Step(4));
  ASSERT_EQ(reached.size(), 1U);
  EXPECT_NEAR(std::exp(reached[0].log_height), kEye, 1e-9);
  EXPECT_EQ(reached[0].way, 0.5);
  EXPECT_EQ(ahead.size(), 0U) << "it is told once";
}

// What the plane says of the ground far from where it was seen does not matter.
TEST(GroundAhead, DoesNotMindASlopeThatIsWrongWhereTheCameraWas) {
  for (const double slope : {-0.05, 0.05}) {
    GroundAhead ahead;
    const Eigen::Vector3d plane = Plane(slope, 3 * kEye);
    EXPECT_GT(std::abs(std::log(1 / plane.norm() / kEye)), 0.1);
    ahead.Add(plane, Pose(), 0.5);
    const std::vector<double> heights = DriveOver(&ahead, Step(0.5));
    ASSERT_EQ(heights.size(), 1U);
    EXPECT_LT(std::abs(std::log(heights[0] / kEye)), 0.04) << slope;
  }
}

TEST(GroundAhead, TellsHowTheCameraRose) {
  GroundAhead ahead;
  ahead.Add(Plane(0, 0), Pose(), 0.5);
  const std::vector<double> heights = DriveOver(&ahead, Step(0.5, 0, -0.02));
  ASSERT_EQ(heights.size(), 1U);
  EXPECT_GT(heights[0], kEye + 0.15);
  EXPECT_LT(heights[0], kEye + 0.25);
}

TEST(GroundAhead, SaysNothingOfWhatATurnPassesBy) {
  GroundAhead ahead;
  ahead.Add(Plane(0, 0), Pose(), 0.5);
  EXPECT_TRUE(DriveOver(&ahead, Step(0.5, 0.3)).empty());
  EXPECT_EQ(ahead.size(), 0U);
}

// A camera that drives into the ground is above nothing.
TEST(GroundAhead, SaysNothingFromBelowTheGround) {
  GroundAhead ahead;
  ahead.Add(Plane(0, 0), Pose(), 0.5);
  EXPECT_TRUE(DriveOver(&ahead, Step(0.5, 0, 0.3)).empty());
}

TEST(GroundAhead, GrowsWithTheMap) {
  GroundAhead ahead;
  ahead.Add(Plane(0, 0), Step(2), 0.5);
  ahead.Scale(3);
  EXPECT_TRUE(ahead.Approach(Step(2)).empty());
  const auto reached = ahead.Approach(Step(8));
  ASSERT_EQ(reached.size(), 1U);
  EXPECT_NEAR(std::exp(reached[0].log_height), 3 * kEye, 1e-9);
}

TEST(GroundAhead, KeepsFewWhereTheCameraTurnsBack) {
  GroundAhead ahead;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_TRUE(ahead.Approach(Step(i % 2 == 0 ? 1 : -1)).empty());
    ahead.Add(Plane(0, 0), Pose(), 0.5);
  }
  EXPECT_LE(ahead.size(), 12U);
  EXPECT_TRUE(ahead.IsPossible());
}

TEST(GroundAhead, IsImpossibleWithAPlaneOrAPoseThatIsNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  GroundAhead none, no_number, no_way, no_pose;
  none.Add(Eigen::Vector3d::Zero(), Pose(), 0.5);
  no_number.Add({nan, 1, 0}, Pose(), 0.5);
  no_way.Add(Plane(0, 0), Pose(), -1);
  no_pose.Add(Plane(0, 0), Pose(Eigen::Quaterniond::Identity(), {nan, 0, 0}), 0.5);
  for (const GroundAhead* ahead : {&none, &no_number, &no_way, &no_pose}) EXPECT_FALSE(ahead->IsPossible());
  EXPECT_TRUE(GroundAhead().IsPossible());
}

}  // namespace
}  // namespace tutti
