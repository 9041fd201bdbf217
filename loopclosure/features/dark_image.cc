#include "loopclosure/features/dark_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "loopclosure/features/gaussian_blur.h"

namespace tutti::internal {
namespace {

constexpr double kNoisy = 0.05;     // share of the range from which on an image is cleared
constexpr int kSample = 1 << 15;    // about as many pixels tell noise and range
constexpr int kWindow = 5;          // of the filter [px]
constexpr double kSmoothing = 0.7;  // standard deviation of what is smoothed after it [px]
constexpr double kRange = 160;      // of a cleared image [grey levels]
constexpr double kMostGain = 8;

template <std::size_t N>
int Quantile(const std::array<int, N>& histogram, double share) {
  std::int64_t all = 0, sum = 0;
  for (const int count : histogram) all += count;
  int value = 0;
  for (; value + 1 < static_cast<int>(N); ++value) {
    sum += histogram[static_cast<std::size_t>(value)];
    if (static_cast<double>(sum) > share * static_cast<double>(all)) break;
  }
  return value;
}

// Wiener's filter: what varies around a pixel no more than noise does becomes the mean, the rest stays.
void TakeOutNoise(const cv::Mat& grey, double noise, cv::Mat& clean) {
  cv::Mat sums, squares;  // whole numbers: exact whatever OpenCV does
  cv::boxFilter(grey, sums, CV_32S, {kWindow, kWindow}, {-1, -1}, false, cv::BORDER_REFLECT_101);
  cv::sqrBoxFilter(grey, squares, CV_32S, {kWindow, kWindow}, {-1, -1}, false, cv::BORDER_REFLECT_101);
  constexpr float kShare = 1.0f / (kWindow * kWindow);
  const auto chance = static_cast<float>(noise * noise);
  clean.create(grey.size(), CV_32F);
  for (int y = 0; y < grey.rows; ++y) {
    const std::uint8_t* values = grey.ptr(y);
    const auto *sum = sums.ptr<std::int32_t>(y), *square = squares.ptr<std::int32_t>(y);
    float* to = clean.ptr<float>(y);
    for (int x = 0; x < grey.cols; ++x) {
      const float mean = static_cast<float>(sum[x]) * kShare;
      const float variance = static_cast<float>(square[x]) * kShare - mean * mean;
      const float kept = variance > chance ? (variance - chance) / variance : 0.0f;
      to[x] = mean + kept * (static_cast<float>(values[x]) - mean);
    }
  }
}

}  // namespace

ImageContrast ContrastOf(const cv::Mat& grey) {
  constexpr double kNormal = 0.6745 * 6;  // median of the mask's absolute values by sigma
  ImageContrast contrast;
  if (grey.rows < 3 || grey.cols < 3) return contrast;
  std::array<int, 256> values{};
  std::array<int, 8 * 255 + 1> differences{};
  const int step = std::max(1, static_cast<int>(grey.total()) / kSample);
  for (int y = 1; y + 1 < grey.rows; y += step) {
    const std::uint8_t *above = grey.ptr(y - 1), *here = grey.ptr(y), *below = grey.ptr(y + 1);
    for (int x = 1; x + 1 < grey.cols; ++x) {
      const int corners = above[x - 1] + above[x + 1] + below[x - 1] + below[x + 1];
      const int sides = above[x] + below[x] + here[x - 1] + here[x + 1];
      ++values[here[x]];
      ++differences[static_cast<std::size_t>(std::abs(corners - 2 * sides + 4 * here[x]))];
    }
  }
  contrast.noise = Quantile(differences, 0.5) / kNormal;
  contrast.low = Quantile(values, 0.01);
  contrast.high = Quantile(values, 0.99);
  return contrast;
}

cv::Mat Cleared(const cv::Mat& grey) {
  const ImageContrast contrast = ContrastOf(grey);
  if (contrast.NoiseShare() < kNoisy || contrast.high <= contrast.low) return grey;
  cv::Mat clean, smooth, cleared;
  TakeOutNoise(grey, contrast.noise, clean);
  GaussianBlur(clean, kSmoothing, smooth);
  const double gain = std::clamp(kRange / (contrast.high - contrast.low), 1.0, kMostGain);
  const double middle = 0.5 * (contrast.low + contrast.high);
  smooth.convertTo(cleared, CV_8U, gain, 127.5 - gain * middle);
  return cleared;
}

}  // namespace tutti::internal
