#include "data/synthetic/hand.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tutti::synthetic {
namespace {

TEST(HandTest, TurnsAboutEachAxisAsFastAsToldAndIsCalmBetweenBursts) {
  const double peak = 200;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Hand hand(seed, peak);
    Eigen::Vector3d fastest = Eigen::Vector3d::Zero();
    int calm = 0, moments = 0;
    constexpr double kStep = 0.005;
    for (double t = 0; t < 20; t += kStep, ++moments) {
      const Pose step = hand.At(t).Inverse() * hand.At(t + kStep);
      const Eigen::Vector3d speed = LogSE3(step).tail<3>() * (180 / M_PI / kStep);
      fastest = fastest.cwiseMax(speed.cwiseAbs());
      calm += speed.norm() < 0.1 * peak ? 1 : 0;
      EXPECT_LT(step.translation.norm(), 2 * 0.21 * step.Angle() + 1e-9);  // on its lever
    }
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GT(fastest(axis), 0.5 * peak) << "axis " << axis << " seed " << seed;
      EXPECT_LT(fastest(axis), 1.6 * peak) << "axis " << axis << " seed " << seed;
    }
    EXPECT_GT(calm, 0.1 * moments) << seed;
    EXPECT_LT(calm, 0.6 * moments) << seed;
  }
}

TEST(HandTest, StartsAtRestAndASteadyHandStays) {
  EXPECT_LT(LogSE3(Hand(1, 200).At(0.02)).norm(), 1e-3);
  EXPECT_EQ(LogSE3(Hand(1, 0).At(2)).norm(), 0);
}

}  // namespace
}  // namespace tutti::synthetic
