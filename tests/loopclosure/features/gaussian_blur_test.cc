#include "loopclosure/features/smoothing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

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
