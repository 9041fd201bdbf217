// How uncertain an odometry is, by steps whose errors are known.
#include "apps/slam/odometry_uncertainty.h"

#include <gtest/gtest.h>

#include <random>

namespace tutti {
namespace {

constexpr double kWay = 0.5;

StepCheck Step(const Eigen::Vector3d& share, const Eigen::Vector3d& rotation) {
  StepCheck check;
  check.way_m = kWay;
  check.translation_m = share * kWay;
  check.rotation_rad = rotation;
  check.sigma_translation_m = 0.001 * kWay;
  check.sigma_rotation_rad = 0.0005;
  return check;
}

class Noise {
 public:
  explicit Noise(std::uint64_t seed) : random_(seed) {}
  Eigen::Vector3d operator()(double sigma) {
    return sigma * Eigen::Vector3d(normal_(random_), normal_(random_), normal_(random_));
  }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

TEST(OdometryUncertainty, SaysNothingOfFewSteps) {
  OdometryUncertainty uncertainty;
  for (int i = 0; i < 7; ++i) uncertainty.Add(Step({0.1, 0, 0}, {0, 0.1, 0}));
  EXPECT_EQ(uncertainty.Estimate().fraction, 0);
  EXPECT_EQ(uncertainty.Estimate().rotation_rad, 0);
}

TEST(OdometryUncertainty, FindsTheStandardDeviationOfIndependentErrors) {
  OdometryUncertainty uncertainty;
  Noise noise(1);
  for (int i = 0; i < 500; ++i) uncertainty.Add(Step(noise(0.03), noise(0.01)));
  EXPECT_NEAR(uncertainty.Estimate().fraction, 0.03, 0.01);
  EXPECT_NEAR(uncertainty.Estimate().rotation_rad, 0.01, 0.0035);
}

TEST(OdometryUncertainty, AnErrorOfOneAxisCountsInFull) {
  OdometryUncertainty uncertainty;
  Noise noise(2);
  for (int i = 0; i < 500; ++i) uncertainty.Add(Step({0, 0, 0}, {0, noise(0.01).x(), 0}));
  EXPECT_NEAR(uncertainty.Estimate().rotation_rad, 0.01, 0.0035);
}

TEST(OdometryUncertainty, AnErrorThatStaysCountsAsWhatItBecomesOverManySteps) {
  OdometryUncertainty uncertainty;
  for (int i = 0; i < 200; ++i) uncertainty.Add(Step({0, 0, 0.01}, {0, 0.004, 0}));
  EXPECT_GT(uncertainty.Estimate().fraction, 3.9 * 0.01);
  EXPECT_GT(uncertainty.Estimate().rotation_rad, 3.9 * 0.004);
}

TEST(OdometryUncertainty, WhatTheImagesThemselvesErrByDoesNotCount) {
  OdometryUncertainty uncertainty;
  Noise noise(3);
  for (int i = 0; i < 500; ++i) uncertainty.Add(Step(noise(0.001), noise(0.0005)));
  EXPECT_LT(uncertainty.Estimate().fraction, 0.001);
  EXPECT_LT(uncertainty.Estimate().rotation_rad, 0.0005);
}

TEST(OdometryUncertainty, OfALengthIsNeverSoLargeThatAnyLoopFits) {
  OdometryUncertainty uncertainty;
  Noise noise(5);
  for (int i = 0; i < 100; ++i) uncertainty.Add(Step(noise(0.5), noise(0.01)));
  EXPECT_EQ(uncertainty.Estimate().fraction, 0.05);
}

TEST(OdometryUncertainty, FewStepsThatTheImagesGotWrongDoNotMatter) {
  OdometryUncertainty uncertainty;
  Noise noise(4);
  for (int i = 0; i < 500; ++i)
    uncertainty.Add(i % 40 == 0 ? Step({5, 5, 5}, {1, 1, 1}) : Step(noise(0.01), noise(0.002)));
  EXPECT_LT(uncertainty.Estimate().fraction, 0.03);
}

}  // namespace
}  // namespace tutti
