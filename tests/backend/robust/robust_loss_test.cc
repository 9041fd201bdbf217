#include "backend/robust/robust_loss.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

using internal::RobustCost;
using internal::RobustWeight;

TEST(RobustLoss, WeightIsTheDerivativeOfTheCost) {
  for (RobustLoss robust : {RobustLoss::kNone, RobustLoss::kHuber, RobustLoss::kCauchy, RobustLoss::kDcs}) {
    for (double s : {0.1, 3.9, 4.1, 10.0, 1e3, 1e6}) {
      const double h = 1e-5 * s;
      const double numeric = (RobustCost(robust, s + h, 4.0) - RobustCost(robust, s - h, 4.0)) / (2 * h);
      EXPECT_NEAR(RobustWeight(robust, s, 4.0), numeric, 1e-5) << ToString(robust) << " at " << s;
    }
  }
}

TEST(RobustLoss, DcsIsBoundedAndSmoothAtItsThreshold) {
  EXPECT_NEAR(RobustCost(RobustLoss::kDcs, 4.0 + 1e-9, 4.0), 4.0, 1e-8);
  EXPECT_NEAR(RobustWeight(RobustLoss::kDcs, 4.0 + 1e-9, 4.0), 1.0, 1e-8);
  EXPECT_LT(RobustCost(RobustLoss::kDcs, 1e12, 4.0), 12.0);
  double rho[3];
  internal::DcsLoss(4.0).Evaluate(10.0, rho);
  const double h = 1e-4;
  const double numeric =
      (RobustWeight(RobustLoss::kDcs, 10 + h, 4.0) - RobustWeight(RobustLoss::kDcs, 10 - h, 4.0)) / (2 * h);
  EXPECT_NEAR(rho[2], numeric, 1e-7);
}

TEST(RobustLoss, GncWeightsGoFromSmoothToInOrOut) {
  // Small mu: smooth, and nothing is out yet.
  EXPECT_GT(internal::GncTlsWeight(1e3, 4.0, 1e-3), 0.0);
  EXPECT_LT(internal::GncTlsWeight(1e3, 4.0, 1e-3), internal::GncTlsWeight(10.0, 4.0, 1e-3));
  EXPECT_EQ(internal::GncTlsWeight(3.9, 4.0, 1e6), 1.0);
  EXPECT_EQ(internal::GncTlsWeight(4.1, 4.0, 1e6), 0.0);
  EXPECT_NEAR(internal::GncTlsWeight(4.0, 4.0, 2.0), std::sqrt(6.0) - 2.0, 1e-12);
}

TEST(RobustLoss, GncTruncates) {
  EXPECT_EQ(RobustCost(RobustLoss::kGnc, 3.0, 4.0), 3.0);
  EXPECT_EQ(RobustCost(RobustLoss::kGnc, 300.0, 4.0), 4.0);
}

}  // namespace
}  // namespace tutti
