#include "core/fast_corners.h"

#include <gtest/gtest.h>

#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

namespace tutti::internal {
namespace {

// Number of corners; both ways have to give the same.
std::size_t Compare(const cv::Mat& image, int threshold) {
  std::vector<cv::KeyPoint> expected;
  cv::FAST(image, expected, threshold, true);
  const std::vector<cv::KeyPoint> corners = FastCorners(image, threshold);
  EXPECT_EQ(corners.size(), expected.size()) << image.size() << " at " << threshold;
  for (std::size_t i = 0; i < std::min(corners.size(), expected.size()); ++i) {
    const cv::KeyPoint &a = corners[i], &b = expected[i];
    if (a.pt == b.pt && a.response == b.response && a.size == b.size && a.angle == b.angle &&
        a.octave == b.octave && a.class_id == b.class_id)
      continue;
    ADD_FAILURE() << image.size() << " at " << threshold << ": corner " << i << " at " << a.pt << ", not "
                  << b.pt;
    break;
  }
  return expected.size();
}

// Noise that is smooth, black and white, or neither.
cv::Mat NoiseOfKind(int kind, const cv::Size& size, cv::RNG& random) {
  cv::Mat noise(size, CV_8UC1), image;
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  if (kind == 0) return noise;
  cv::GaussianBlur(noise, image, cv::Size(5, 5), 1.2);
  return kind == 1 ? image : cv::Mat(image > 140);
}

TEST(FastCorners, AreThoseOfOpenCv) {
  cv::RNG random(3);
  std::size_t corners = 0;
  for (int kind = 0; kind < 3; ++kind) {
    const cv::Mat image = NoiseOfKind(kind, {333, 240}, random);
    for (const int threshold : {0, 1, 7, 20, 60, 254, 255}) corners += Compare(image, threshold);
  }
  EXPECT_GT(corners, 10000U);
}

TEST(FastCorners, AreThoseOfOpenCvInImagesOfAnySize) {
  cv::RNG random(4);
  std::size_t corners = 0;
  for (int i = 0; i < 1500; ++i) {
    const cv::Size size(random.uniform(1, 60), random.uniform(1, 30));
    corners += Compare(NoiseOfKind(i % 3, size, random), random.uniform(0, 80));
  }
  EXPECT_GT(corners, 1000U);
}

TEST(FastCorners, AreThoseOfOpenCvInPartsOfAnImage) {
  cv::RNG random(5);
  const cv::Mat image = NoiseOfKind(1, {200, 100}, random);
  EXPECT_GT(Compare(image(cv::Rect(13, 7, 101, 60)), 10), 0U);
}

}  // namespace
}  // namespace tutti::internal
