#include "core/orb_description.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace tutti::internal {
namespace {

cv::Mat Texture(std::uint64_t seed, const cv::Size& size) {
  cv::RNG random(seed);
  cv::Mat noise(size, CV_8UC1), image;
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::blur(noise, image, {5, 5});
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

std::vector<cv::KeyPoint> Corners(const cv::Size& size) {
  std::vector<cv::KeyPoint> corners;
  for (int y = 30; y < size.height - 30; y += 11) {
    for (int x = 30; x < size.width - 30; x += 13)
      corners.emplace_back(cv::Point2f(cv::Point(x, y)), 31.0F, static_cast<float>((7 * x + 13 * y) % 360));
  }
  return corners;
}

cv::Mat Described(const cv::Mat& image, const std::vector<cv::KeyPoint>& corners) {
  const OrbDescription description(image);
  cv::Mat bits(static_cast<int>(corners.size()), OrbDescription::kBytes, CV_8UC1);
  for (int i = 0; i < bits.rows; ++i) {
    const cv::KeyPoint& corner = corners[static_cast<std::size_t>(i)];
    description.Describe(static_cast<int>(corner.pt.x), static_cast<int>(corner.pt.y), corner.angle,
                         bits.ptr(i));
  }
  return bits;
}

bool Fuses() { return cv::checkHardwareSupport(CV_CPU_AVX2) && cv::checkHardwareSupport(CV_CPU_FMA3); }

// Without FMA, cv::ORB rounds otherwise: some bits compare pixels that are all but equal.
TEST(OrbDescription, TheBitsAreThoseOfOpenCv) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    for (const cv::Size size : {cv::Size(640, 480), cv::Size(1241, 376), cv::Size(101, 83)}) {
      const cv::Mat image = Texture(seed, size);
      std::vector<cv::KeyPoint> corners = Corners(image.size());
      const std::size_t count = corners.size();
      cv::Mat expected;
      cv::ORB::create(1, 1.2F, 1, 19)->compute(image, corners, expected);
      ASSERT_EQ(corners.size(), count);
      const double bits = 8.0 * static_cast<double>(expected.total());
      EXPECT_LE(cv::norm(Described(image, corners), expected, cv::NORM_HAMMING), Fuses() ? 0 : 0.002 * bits)
          << seed;
    }
  }
}

TEST(OrbDescription, TheImageMayBeAPartOfALargerOne) {
  const cv::Mat whole = Texture(4, {640, 480}), part = whole(cv::Rect(100, 50, 300, 200));
  const std::vector<cv::KeyPoint> corners = Corners(part.size());
  EXPECT_EQ(cv::norm(Described(part, corners), Described(part.clone(), corners), cv::NORM_HAMMING), 0);
}

// AVX2 and FMA, where the processor has them, or plain x86-64, where the C library fuses.
TEST(OrbDescription, InstructionsThatOpenCvMayUseChangeNoBit) {
  const cv::Mat image = Texture(5, {3000, 2000});
  const std::vector<cv::KeyPoint> corners = Corners(image.size());
  const cv::Mat all = Described(image, corners);
  cv::setUseOptimized(false);
  const cv::Mat plain = Described(image, corners);
  cv::setUseOptimized(true);
  EXPECT_EQ(cv::norm(all, plain, cv::NORM_HAMMING), 0);
}

}  // namespace
}  // namespace tutti::internal
