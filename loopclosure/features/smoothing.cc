#include "loopclosure/features/smoothing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "core/inner_loops.h"
#include "core/numbers.h"

namespace tutti::internal {
namespace {

// Eight floats side by side: one register of AVX2, two of SSE.
using Eight = float __attribute__((vector_size(32)));
constexpr int kEight = 8, kBlock = 4 * kEight;  // [px]; a block's sums stay in registers

/// sum += weight (a + b), of arrays anywhere in memory: no alignment is asked for.
TUTTI_CHECKED_AS_A_WHOLE inline void Add(float weight, const float* a, const float* b, Eight& sum) {
  Eight left, right;
  std::memcpy(&left, a, sizeof(left));
  std::memcpy(&right, b, sizeof(right));
  sum += weight * (left + right);
}

/// out[x] = k[0] left[0][x] + sum over 0 < i < taps of k[i] (left[i][x] + right[i][x]), summed up in this
/// order.
TUTTI_CLONES("avx2")
TUTTI_CHECKED_AS_A_WHOLE void SymmetricSum(const float* const* left, const float* const* right,
                                           const float* kernel, std::size_t taps, int count, float* out) {
  for (std::size_t i = 0; i < taps; ++i) {
    CheckReadable(left[i], Index(count));
    CheckReadable(right[i], Index(count));
  }
  CheckWritable(out, Index(count));
  int x = 0;
  for (; x + kBlock <= count; x += kBlock) {
    Eight s0, s1, s2, s3;
    std::memcpy(&s0, left[0] + x, sizeof(s0));
    std::memcpy(&s1, left[0] + x + kEight, sizeof(s1));
    std::memcpy(&s2, left[0] + x + 2 * kEight, sizeof(s2));
    std::memcpy(&s3, left[0] + x + 3 * kEight, sizeof(s3));
    s0 *= kernel[0], s1 *= kernel[0], s2 *= kernel[0], s3 *= kernel[0];
    for (std::size_t i = 1; i < taps; ++i) {
      const float *a = left[i] + x, *b = right[i] + x;
      Add(kernel[i], a, b, s0);
      Add(kernel[i], a + kEight, b + kEight, s1);
      Add(kernel[i], a + 2 * kEight, b + 2 * kEight, s2);
      Add(kernel[i], a + 3 * kEight, b + 3 * kEight, s3);
    }
    std::memcpy(out + x, &s0, sizeof(s0));
    std::memcpy(out + x + kEight, &s1, sizeof(s1));
    std::memcpy(out + x + 2 * kEight, &s2, sizeof(s2));
    std::memcpy(out + x + 3 * kEight, &s3, sizeof(s3));
  }
  for (; x < count; ++x) {
    float sum = kernel[0] * left[0][x];
    for (std::size_t i = 1; i < taps; ++i) sum += kernel[i] * (left[i][x] + right[i][x]);
    out[x] = sum;
  }
}

/// From the middle to the end; with its mirror image the sum is 1.
std::vector<float> HalfKernel(double sigma) {
  const int radius = static_cast<int>(std::ceil(3.0 * sigma));
  const cv::Mat whole = cv::getGaussianKernel(2 * radius + 1, sigma, CV_32F);
  std::vector<float> half;
  for (int i = radius; i <= 2 * radius; ++i) half.push_back(whole.at<float>(i));
  return half;
}

}  // namespace

void GaussianBlur(const cv::Mat& from, double sigma, cv::Mat& to) {
  CV_Assert(from.type() == CV_32FC1 && from.data != to.data);
  to.create(from.size(), CV_32FC1);
  const std::vector<float> kernel = HalfKernel(sigma);
  const int radius = static_cast<int>(kernel.size()) - 1;
  std::vector<const float*> left(kernel.size()), right(kernel.size());
  std::vector<float> line(Index(from.cols + 2 * radius));  // with its mirrored ends
  float* const begin = line.data() + radius;
  std::vector<std::pair<int, int>> mirrored;  // pixel outside, and the one inside that it shows
  for (int x = 1; x <= radius; ++x) {
    for (const int outside : {-x, from.cols - 1 + x}) {
      mirrored.emplace_back(outside, cv::borderInterpolate(outside, from.cols, cv::BORDER_REFLECT_101));
    }
  }
  for (int y = 0; y < from.rows; ++y) {
    for (int i = 0; i <= radius; ++i) {
      const auto at = Index(i);
      left[at] = from.ptr<float>(cv::borderInterpolate(y - i, from.rows, cv::BORDER_REFLECT_101));
      right[at] = from.ptr<float>(cv::borderInterpolate(y + i, from.rows, cv::BORDER_REFLECT_101));
    }
    SymmetricSum(left.data(), right.data(), kernel.data(), kernel.size(), from.cols, begin);
    for (const auto& [outside, inside] : mirrored) begin[outside] = begin[inside];
    for (int i = 0; i <= radius; ++i) {
      left[Index(i)] = begin - i;
      right[Index(i)] = begin + i;
    }
    SymmetricSum(left.data(), right.data(), kernel.data(), kernel.size(), from.cols, to.ptr<float>(y));
  }
}

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
      ++differences[Index(std::abs(corners - 2 * sides + 4 * here[x]))];
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
