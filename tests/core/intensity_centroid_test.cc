#include "core/intensity_centroid.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti::internal {
namespace {

constexpr int kPatchSide = 2 * IntensityCentroid::kMargin + 1;
constexpr int kMiddle = IntensityCentroid::kMargin;

// A patch of the disc of that radius [px].
IntensityCentroid Disc(int radius) {
  IntensityCentroid::HalfWidths widths{};
  for (int v = 0; v <= IntensityCentroid::kRadius; ++v) {
    const int rest = radius * radius - v * v;
    widths[static_cast<std::size_t>(v)] = rest < 0 ? 0 : static_cast<int>(std::sqrt(rest));
  }
  return IntensityCentroid(widths);
}

TEST(IntensityCentroid, PointsToWhatIsBright) {
  for (int degrees = 0; degrees < 360; degrees += 15) {
    cv::Mat image(kPatchSide, kPatchSide, CV_8UC1);
    const double angle = degrees * CV_PI / 180;
    for (int y = 0; y < kPatchSide; ++y) {
      for (int x = 0; x < kPatchSide; ++x) {
        const double along = (x - kMiddle) * std::cos(angle) + (y - kMiddle) * std::sin(angle);
        image.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(128 + 4 * along);
      }
    }
    const double found = Disc(IntensityCentroid::kRadius).Angle(image, kMiddle, kMiddle);
    EXPECT_NEAR(std::remainder(found - degrees, 360), 0, 1) << degrees;
  }
}

TEST(IntensityCentroid, IsThatOfTheSumsOverThePatchAlone) {
  cv::RNG random(1);
  cv::Mat image(kPatchSide, kPatchSide, CV_8UC1);
  random.fill(image, cv::RNG::UNIFORM, 0, 256);
  for (const int radius : {3, 10, IntensityCentroid::kRadius}) {
    int m10 = 0, m01 = 0;
    for (int v = -IntensityCentroid::kRadius; v <= IntensityCentroid::kRadius; ++v) {
      const int rest = radius * radius - v * v, width = rest < 0 ? 0 : static_cast<int>(std::sqrt(rest));
      for (int u = -width; u <= width; ++u) {
        const int grey = image.at<std::uint8_t>(kMiddle + v, kMiddle + u);
        m10 += u * grey;
        m01 += v * grey;
      }
    }
    EXPECT_EQ(Disc(radius).Angle(image, kMiddle, kMiddle),
              cv::fastAtan2(static_cast<float>(m01), static_cast<float>(m10)))
        << radius;
  }
}

}  // namespace
}  // namespace tutti::internal
