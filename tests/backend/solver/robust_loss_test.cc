#include "backend/solver/robust_loss.h"

#include <gtest/gtest.h>

#include <cmath>

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

TEST(RobustLoss, DcsIsBoundedAndSmoothAtItsThresholdAndGncTruncates) {
  EXPECT_EQ(RobustCost(RobustLoss::kGnc, 3.0, 4.0), 3.0);
  EXPECT_EQ(RobustCost(RobustLoss::kGnc, 300.0, 4.0), 4.0);
  EXPECT_NEAR(RobustCost(RobustLoss::kDcs, 4.0 + 1e-9, 4.0), 4.0, 1e-8);
  EXPECT_NEAR(RobustWeight(RobustLoss::kDcs, 4.0 + 1e-9, 4.0), 1.0, 1e-8);
  EXPECT_LT(RobustCost(RobustLoss::kDcs, 1e12, 4.0), 12.0);
}

TEST(RobustLoss, DerivativesThatCeresGetsAreThoseOfTheCost) {
  const internal::DcsLoss dcs(4.0);
  const internal::GemanMcClureLoss geman_mcclure(4.0);
  for (const ceres::LossFunction* loss : {static_cast<const ceres::LossFunction*>(&dcs),
                                          static_cast<const ceres::LossFunction*>(&geman_mcclure)}) {
    for (double s : {0.5, 3.0, 6.0, 10.0, 50.0}) {
      constexpr double kStep = 1e-5;
      double here[3], before[3], after[3];
      loss->Evaluate(s, here);
      loss->Evaluate(s - kStep, before);
      loss->Evaluate(s + kStep, after);
      EXPECT_NEAR(here[1], (after[0] - before[0]) / (2 * kStep), 1e-8) << s;
      EXPECT_NEAR(here[2], (after[1] - before[1]) / (2 * kStep), 1e-8) << s;
    }
  }
  double rho[3];
  geman_mcclure.Evaluate(4.0, rho);
  EXPECT_NEAR(rho[0], 2.0, 1e-12) << "half of its bound where s is the threshold";
}

// Probability that a chi-square variable is smaller, by numerical integration of its density.
double ChiSquareProbability(int degrees_of_freedom, double quantile) {
  constexpr int kSteps = 20000;
  const double half = 0.5 * degrees_of_freedom, step = quantile / kSteps;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double x = (i + 0.5) * step;
    sum += step * std::pow(x, half - 1) * std::exp(-0.5 * x);
  }
  return sum / (std::pow(2.0, half) * std::tgamma(half));
}

TEST(ChiSquare, QuantilesHaveTheirProbabilities) {
  for (int n : {3, 6, 7}) {
    EXPECT_NEAR(ChiSquareProbability(n, internal::ChiSquare99(n)), 0.99, 1e-6) << n;
    EXPECT_NEAR(ChiSquareProbability(n, internal::ChiSquareMedian(n)), 0.5, 1e-6) << n;
  }
}

}  // namespace
}  // namespace tutti
