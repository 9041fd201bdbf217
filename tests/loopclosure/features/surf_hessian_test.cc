#include "loopclosure/features/surf_hessian.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tutti::internal {
namespace {

cv::Mat GreyNoise(const cv::Size& size) {
  std::mt19937 generator(static_cast<std::uint32_t>(size.area()));
  cv::Mat image(size, CV_8UC1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x)
      image.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(generator());
  }
  return image;
}

// Sum of the grey levels of a box around a pixel, pixel by pixel.
double SumOf(const cv::Mat& image, int left, int right, int top, int bottom) {
  double sum = 0;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) sum += image.at<std::uint8_t>(y, x);
  }
  return sum;
}

// The determinant of the paper, of box filters of 3 times `lobe` pixels (its figure 2): second derivatives
// are three lobes side by side that weigh 1, -2, 1, the mixed one four squares that touch neither axis.
// Negative where the trace is.
double Determinant(const cv::Mat& image, int x, int y, int lobe) {
  const int half = lobe / 2, wide = (3 * lobe - 1) / 2, reach = lobe - 1;
  const double area = 9.0 * lobe * lobe;
  const double xx = (SumOf(image, x - wide, x + wide, y - reach, y + reach) -
                     3 * SumOf(image, x - half, x + half, y - reach, y + reach)) /
                    area;
  const double yy = (SumOf(image, x - reach, x + reach, y - wide, y + wide) -
                     3 * SumOf(image, x - reach, x + reach, y - half, y + half)) /
                    area;
  const double xy =
      (SumOf(image, x + 1, x + lobe, y - lobe, y - 1) + SumOf(image, x - lobe, x - 1, y + 1, y + lobe) -
       SumOf(image, x - lobe, x - 1, y - lobe, y - 1) - SumOf(image, x + 1, x + lobe, y + 1, y + lobe)) /
      area;
  return std::copysign(std::max(0.0, xx * yy - 0.81 * xy * xy), xx + yy);
}

// Widths and heights of each remainder by four, of which columns and rows are left over.
TEST(SurfHessian, IsThatOfThePaperAtEveryPlaceOfImagesOfAnySize) {
  constexpr int kOctaves = 2;
  SurfHessian hessian;
  for (const cv::Size& size :
       {cv::Size(132, 129), cv::Size(133, 132), cv::Size(134, 131), cv::Size(135, 130)}) {
    const cv::Mat image = GreyNoise(size);
    SurfIntegral integral;
    integral.Compute(image);
    hessian.Compute(integral, kOctaves);
    for (int octave = 0; octave < kOctaves; ++octave) {
      const int step = SurfHessian::Step(octave);
      EXPECT_EQ(step, 2 << octave);
      for (int interval = 0; interval < SurfHessian::kIntervals; ++interval) {
        const int lobe = (2 << octave) * (interval + 1) + 1;
        const cv::Mat& layer = hessian.Layer(octave, interval);
        const int border = SurfHessian::Border(interval);
        ASSERT_GT(layer.rows, 2 * border);
        int places = 0;
        for (int r = border; r * step < size.height - border * step && r < layer.rows; ++r) {
          for (int c = border; c * step < size.width - border * step && c < layer.cols; ++c, ++places) {
            const double expected = Determinant(image, c * step, r * step, lobe);
            ASSERT_NEAR(layer.at<double>(r, c), expected, 1e-9 * std::abs(expected))
                << size << " octave " << octave << ", interval " << interval << ": " << c << ", " << r;
          }
        }
        EXPECT_GT(places, 10);
      }
    }
  }
}

}  // namespace
}  // namespace tutti::internal
