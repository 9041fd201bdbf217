#include "frontend/odometry/exposure_estimate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

namespace tutti {
namespace {

// Misfits of images that were exposed for so long.
ExposureEstimate::Misfits ExposedFor(double exposure_s, double blur = 4e4) {
  ExposureEstimate::Misfits misfits{};
  for (int i = 0; i < ImageAligner::kExposures; ++i)
    misfits[static_cast<std::size_t>(i)] = 1 + blur * std::pow(ImageAligner::Exposure(i) - exposure_s, 2);
  return misfits;
}

TEST(ExposureEstimate, IsKnownOnceAFrameHasSaidSomething) {
  ExposureEstimate estimate;
  EXPECT_FALSE(estimate.IsKnown());
  EXPECT_EQ(estimate.Seconds(), 0);
  estimate.Add(ExposedFor(0.0312));
  EXPECT_TRUE(estimate.IsKnown());
  EXPECT_NEAR(estimate.Seconds(), 0.0312, 1e-6) << "between two of those that were compared";
}

TEST(ExposureEstimate, IsNoneWhereBlurExplainsNothing) {
  ExposureEstimate estimate;
  for (int frame = 0; frame < 5; ++frame) estimate.Add(ExposedFor(0.02, 20));
  EXPECT_TRUE(estimate.IsKnown());
  EXPECT_EQ(estimate.Seconds(), 0) << "half of the differences at least";
  for (int frame = 0; frame < 5; ++frame) estimate.Add(ExposedFor(0));
  EXPECT_EQ(estimate.Seconds(), 0);
}

TEST(ExposureEstimate, IsOpenAsLongAsBlurExplainsMuchButNotEnough) {
  const auto said = [](double blur, double exposure_s) {
    ExposureEstimate estimate;
    estimate.Add(ExposedFor(exposure_s, blur));
    return estimate;
  };
  EXPECT_TRUE(ExposureEstimate().IsOpen());
  EXPECT_TRUE(said(800, 0.03).IsOpen()) << "the least difference is 0.58 of that without blur";
  EXPECT_FALSE(said(100, 0.03).IsOpen()) << "0.92: these images are sharp";
  EXPECT_FALSE(said(4000, 0.03).IsOpen()) << "0.22: these are blurred";
  EXPECT_FALSE(said(8000, 0.01).IsOpen()) << "0.56, but sharp images look like this, too";
  ExposureEstimate estimate = said(800, 0.03);
  estimate.Add(ExposedFor(0.03));
  EXPECT_FALSE(estimate.IsOpen());
  EXPECT_NEAR(estimate.Seconds(), 0.03, 1e-6);
}

TEST(ExposureEstimate, FollowsTheLight) {
  ExposureEstimate estimate;
  for (int frame = 0; frame < 20; ++frame) estimate.Add(ExposedFor(0.03));
  for (int frame = 0; frame < 30; ++frame) estimate.Add(ExposedFor(0.015));
  EXPECT_NEAR(estimate.Seconds(), 0.015, 1e-3);
}

TEST(ExposureEstimate, IsTheLongestAtMost) {
  ExposureEstimate estimate;
  for (int frame = 0; frame < 3; ++frame) estimate.Add(ExposedFor(0.1));
  EXPECT_EQ(estimate.Seconds(), ImageAligner::Exposure(ImageAligner::kExposures - 1));
}

}  // namespace
}  // namespace tutti
