#include "frontend/features/grey_window.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

namespace tutti {
namespace {

constexpr int kHalf = 4;

cv::Mat Noise() {
  cv::RNG random(5);
  cv::Mat noise(80, 2100, CV_8UC1);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  return noise;
}

void ExpectSameGrey(const cv::Mat& image, float x, float y) {
  GreyWindow<kHalf> grey;
  BilinearWindow<kHalf>(image.data, image.step, x, y, &grey);
  for (int v = -kHalf, n = 0; v <= kHalf; ++v) {
    for (int u = -kHalf; u <= kHalf; ++u, ++n)
      ASSERT_EQ(grey(n), Bilinear(image.data, image.step, x + float(u), y + float(v))) << x << ' ' << y;
  }
}

TEST(GreyWindow, IsWhatEachSampleIsByItself) {
  const cv::Mat image = Noise();
  cv::RNG random(6);
  for (int i = 0; i < 20000; ++i)
    ExpectSameGrey(image, random.uniform(4.0F, 2094.0F), random.uniform(4.0F, 74.0F));
  ExpectSameGrey(image, 4, 4);
}

TEST(GreyWindow, SurvivesSumsThatAreRoundedToTheNextPixel) {
  const cv::Mat image = Noise();
  for (const float power : {8.0F, 16.0F, 64.0F, 256.0F, 1024.0F, 2048.0F}) {
    const float just_below = std::nextafter(power, 0.0F);
    ASSERT_EQ(just_below + 1, power + 1) << "no such case";
    ExpectSameGrey(image, just_below, 10.5F);
    if (power < 70) ExpectSameGrey(image, 100.25F, just_below);
  }
}

}  // namespace
}  // namespace tutti
