#include "loopclosure/features/smoothing.h"

#include <gtest/gtest.h>

#include <cstddef>
#include <vector>

#include "loopclosure/geometry/matching.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tutti/loopclosure/detector_options.h"
#include "tutti/loopclosure/features.h"

namespace tutti::internal {
namespace {

// Three tenths of the light, and noise.
cv::Mat Dark(const cv::Mat& image, double noise) {
  cv::Mat values, random(image.size(), CV_32F), dark;
  image.convertTo(values, CV_32F, 0.3);
  cv::RNG generator(5);
  generator.fill(random, cv::RNG::NORMAL, 0.0, noise);
  cv::Mat(values + random).convertTo(dark, CV_8U);
  return dark;
}

TEST(DarkImage, NoiseAndRangeAreKnown) {
  cv::Mat ramp(200, 300, CV_8UC1);
  for (int x = 0; x < ramp.cols; ++x) ramp.col(x).setTo(100 + x / 3);
  const ImageContrast clean = ContrastOf(ramp);
  EXPECT_NEAR(clean.low, 100, 2);
  EXPECT_NEAR(clean.high, 199, 2);
  EXPECT_LT(clean.noise, 0.5);
  EXPECT_NEAR(ContrastOf(Dark(ramp, 5.0)).noise, 5.0, 0.5);
}

TEST(DarkImage, ABrightImageStaysAsItIs) {
  const cv::Mat image = testing::TexturedImage(1);
  EXPECT_EQ(Cleared(image).data, image.data);
}

TEST(DarkImage, TheImageGivenIsNotWrittenTo) {
  const cv::Mat dark = Dark(testing::TexturedImage(1), 5.0), before = dark.clone();
  EXPECT_NE(Cleared(dark).data, dark.data);
  EXPECT_EQ(cv::norm(dark, before, cv::NORM_INF), 0.0);
}

TEST(DarkImage, LittleNoiseIsLeftAndGreyValuesAreStretched) {
  const cv::Mat dark = Dark(testing::TexturedImage(1), 5.0);
  const ImageContrast before = ContrastOf(dark), after = ContrastOf(Cleared(dark));
  EXPECT_GT(before.NoiseShare(), 0.05);
  EXPECT_LT(after.NoiseShare(), 0.3 * before.NoiseShare());
  EXPECT_NEAR(after.high - after.low, 160, 40);
}

TEST(DarkImage, OfOneGreyValueOrTooSmallIsLeftAlone) {
  EXPECT_NO_THROW(Cleared(cv::Mat(40, 40, CV_8UC1, cv::Scalar(7))));
  EXPECT_NO_THROW(Cleared(cv::Mat(2, 2, CV_8UC1, cv::Scalar(7))));
}

// A place by day and at dusk. Without Cleared: 52, 137 and 142 matches.
TEST(DarkImage, MatchesItsPlaceByDay) {
  struct Least {
    const char* member;
    std::size_t matches;
  };
  const cv::Mat day = testing::TexturedImage(1), dusk = Dark(testing::SeenAgain(day), 8.0);
  for (const Least& least : {Least{"surf", 80}, Least{"sift", 140}, Least{"orb", 160}}) {
    const FeatureExtractor extractor(least.member, ExtractionOptions());
    const Features a = extractor.Extract(day), b = extractor.Extract(dusk);
    std::vector<cv::Point2f> pixels;
    for (const cv::KeyPoint& keypoint : a.keypoints) pixels.push_back(keypoint.pt);
    const std::vector<Match> matches = MatchDescriptors(b.descriptors, a.descriptors, pixels, 0.8);
    EXPECT_GT(matches.size(), least.matches) << least.member;
  }
}

}  // namespace
}  // namespace tutti::internal
