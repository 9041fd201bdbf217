#include "loopclosure/features/smoothing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <opencv2/imgproc.hpp>
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

namespace tutti {
namespace {

cv::Mat FloatNoise(int width, int height) {
  cv::Mat image(height, width, CV_32FC1);
  cv::RNG(7).fill(image, cv::RNG::UNIFORM, 0.0f, 255.0f);
  return image;
}

TEST(GaussianBlur, IsThatOfOpenCvUpToRounding) {
  for (const cv::Size size : {cv::Size(131, 40), cv::Size(32, 9), cv::Size(5, 3), cv::Size(1, 1)}) {
    for (const double sigma : {0.8, 1.6, 3.1}) {
      const cv::Mat image = FloatNoise(size.width, size.height);
      cv::Mat ours, theirs;
      internal::GaussianBlur(image, sigma, ours);
      const int width = 2 * static_cast<int>(std::ceil(3.0 * sigma)) + 1;
      cv::GaussianBlur(image, theirs, cv::Size(width, width), sigma, sigma, cv::BORDER_REFLECT_101);
      EXPECT_LT(cv::norm(ours, theirs, cv::NORM_INF), 2e-4) << size << " sigma " << sigma;
    }
  }
}

// So that they do not depend on how many pixels an instruction works on, either.
TEST(GaussianBlur, BitsOfAPixelDoNotDependOnItsColumn) {
  const cv::Mat image = FloatNoise(150, 30);
  const double sigma = 1.6;
  const int radius = 5;
  cv::Mat whole;
  internal::GaussianBlur(image, sigma, whole);
  for (int from = 1; from < 34; ++from) {
    cv::Mat part;
    internal::GaussianBlur(image.colRange(from, image.cols), sigma, part);
    const cv::Mat a = whole.colRange(from + radius, image.cols), b = part.colRange(radius, part.cols);
    EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0) << "from column " << from;
  }
}

}  // namespace
}  // namespace tutti
