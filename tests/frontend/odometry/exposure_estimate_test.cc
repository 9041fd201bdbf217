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
