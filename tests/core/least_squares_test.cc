#include "core/least_squares.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti::internal {
namespace {

using Vector1d = Eigen::Matrix<double, 1, 1>;

// y = a exp(b x), seen at five places without error.
struct Curve {
  Eigen::Vector2d unknowns;
  int linearised = 0;

  bool Fit(const GaussNewtonLimits& limits, const Eigen::Vector2d& truth) {
    return GaussNewton<2>(
        limits,
        [&](NormalEquations<2>& equations) {
          ++linearised;
          for (int i = 0; i < 5; ++i) {
            const double x = 0.3 * i, grown = std::exp(unknowns(1) * x);
            const Vector1d r(unknowns(0) * grown - truth(0) * std::exp(truth(1) * x));
            equations.Add(Eigen::Matrix<double, 1, 2>(grown, unknowns(0) * x * grown), r, 1.0);
            equations.cost += r.squaredNorm();
          }
        },
        [&](const Eigen::Vector2d& step) {
          unknowns += step;
          return unknowns.allFinite();
        });
  }
};

const Eigen::Vector2d kTruth(2.0, -0.7), kStart(1.5, -0.4);

TEST(HuberLoss, IsTheSquareBelowItsBoundAndSmoothThere) {
  constexpr double kBound = 5.991, kStep = 1e-6;
  EXPECT_EQ(HuberCost(2.5, kBound), 2.5);
  EXPECT_EQ(HuberWeight(2.5, kBound), 1);
  for (const double s : {0.5, kBound - 0.01, kBound, kBound + 0.01, 100.0, 1e6}) {
    const double numeric = (HuberCost(s + kStep, kBound) - HuberCost(s - kStep, kBound)) / (2 * kStep);
    EXPECT_NEAR(HuberWeight(s, kBound), numeric, 1e-4) << s;
  }
}

TEST(HuberLoss, FarResidualsPullAllAlikeAndInfiniteBoundIsNone) {
  for (const double r : {10.0, 1e3, 1e6}) {
    EXPECT_NEAR(HuberWeight(r * r, 4.0) * r, 2.0, 1e-9) << r;
    EXPECT_EQ(HuberWeight(r * r, INFINITY), 1) << r;
    EXPECT_EQ(HuberCost(r * r, INFINITY), r * r) << r;
  }
}

TEST(TrustRegion, GrowsWithGoodStepsShrinksEverFasterWithBadOnes) {
  TrustRegion region;
  region.radius = 100;
  region.Grow(1);  // as expected
  EXPECT_NEAR(region.radius, 300, 1e-9);
  region.Grow(0.5);  // half of it
  EXPECT_NEAR(region.radius, 300, 1e-9);
  region.Grow(0.1);
  EXPECT_LT(region.radius, 300);
  region.radius = 100;
  EXPECT_TRUE(region.Shrink());
  EXPECT_EQ(region.radius, 50);
  EXPECT_TRUE(region.Shrink());
  EXPECT_EQ(region.radius, 12.5);
  region.Grow(1);
  region.radius = 100;
  EXPECT_TRUE(region.Shrink());
  EXPECT_EQ(region.radius, 50);
}

TEST(TrustRegion, EndsWhereNothingIsLeft) {
  TrustRegion region;
  int steps = 0;
  while (region.Shrink() && steps < 1000) ++steps;
  EXPECT_LT(steps, 30);
}

TEST(GaussNewton, FindsTheMinimum) {
  Curve curve{kStart};
  EXPECT_TRUE(curve.Fit({20, 1e-12}, kTruth));
  EXPECT_LT((curve.unknowns - kTruth).norm(), 1e-9);
  EXPECT_LT(curve.linearised, 15);
}

TEST(GaussNewton, EndsAtTheMostIterations) {
  Curve curve{kStart};
  EXPECT_TRUE(curve.Fit({2}, kTruth));
  EXPECT_EQ(curve.linearised, 2);
  EXPECT_GT((curve.unknowns - kTruth).norm(), 1e-9);
}

TEST(GaussNewton, EndsWhereTheCostNoLongerChanges) {
  Curve curve{kStart};
  EXPECT_TRUE(curve.Fit({50, 0, 1e3}, kTruth));
  EXPECT_EQ(curve.linearised, 2);
}

TEST(GaussNewton, UnknownThatNothingSaysAnythingOfStays) {
  for (const double damping : {0.0, 1e-9}) {
    Eigen::Vector2d x(1, 7);
    EXPECT_TRUE(GaussNewton<2>(
        {10, 1e-12, 0, damping},
        [&](NormalEquations<2>& equations) {
          equations.Add(Eigen::Matrix<double, 1, 2>(1, 0), Vector1d(x(0) - 3), 1.0);
        },
        [&](const Eigen::Vector2d& step) {
          x += step;
          return true;
        }));
    EXPECT_LT((x - Eigen::Vector2d(3, 7)).norm(), 1e-8) << damping;
  }
}

TEST(GaussNewton, StartThatIsNotANumberIsRefusedAndNotMoved) {
  Curve curve{{NAN, -0.4}};
  EXPECT_FALSE(curve.Fit({20, 1e-12}, kTruth));
  EXPECT_EQ(curve.linearised, 1);
  EXPECT_EQ(curve.unknowns(1), -0.4);
}

TEST(GaussNewton, JacobianThatIsNotANumberIsRefused) {
  int moves = 0;
  EXPECT_FALSE(GaussNewton<1>(
      {}, [](NormalEquations<1>& equations) { equations.Add(Vector1d(NAN), Vector1d(1), 1.0); },
      [&](const Vector1d&) { return ++moves > 0; }));
  EXPECT_EQ(moves, 0);
}

TEST(GaussNewton, MoveThatLeadsNowhereEndsIt) {
  int moves = 0;
  EXPECT_FALSE(GaussNewton<1>(
      {}, [](NormalEquations<1>& equations) { equations.hessian(0) = 1; },
      [&](const Vector1d&) { return ++moves < 3; }));
  EXPECT_EQ(moves, 3);
}

}  // namespace
}  // namespace tutti::internal
