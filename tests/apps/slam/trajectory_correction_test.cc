#include "apps/slam/trajectory_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>

#include "tutti/core/error.h"

namespace tutti {
namespace {

Trajectory Straight(std::initializer_list<double> stamps) {
  Trajectory out;
  for (const double s : stamps) out.push_back({s, Pose(Eigen::Quaterniond::Identity(), {s, 0, 0})});
  return out;
}

TEST(CorrectTrajectory, PosesBetweenKeyframesAreMovedByBothAndThoseOutsideByTheNearest) {
  const Trajectory before = Straight({1, 3});
  Trajectory after = before;
  after[1].pose.translation = {5, 1, 0};  // twice as long, and aside
  const Trajectory out = CorrectTrajectory(Straight({0, 1, 2, 3, 4}), before, after);
  ASSERT_EQ(out.size(), 5u);
  EXPECT_TRUE(out[1].pose.translation.isApprox(Eigen::Vector3d(1, 0, 0)));
  EXPECT_TRUE(out[2].pose.translation.isApprox(Eigen::Vector3d(3, 0.5, 0)));
  EXPECT_TRUE(out[3].pose.translation.isApprox(Eigen::Vector3d(5, 1, 0)));
  const double stretch = std::sqrt(17.0) / 2;
  EXPECT_TRUE(out[4].pose.translation.isApprox(Eigen::Vector3d(5 + stretch, 1, 0)));
  EXPECT_NEAR(out[0].pose.translation.x(), 1 - stretch, 1e-12);
  EXPECT_EQ(CorrectTrajectory(before, {}, {}).size(), 2u);
  EXPECT_THROW(CorrectTrajectory(before, before, {}), InputError);
}

}  // namespace
}  // namespace tutti
