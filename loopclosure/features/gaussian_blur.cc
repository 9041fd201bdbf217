#include "loopclosure/features/gaussian_blur.h"

#include <cmath>
#include <cstddef>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "core/inner_loops.h"

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
    CheckReadable(left[i], static_cast<std::size_t>(count));
    CheckReadable(right[i], static_cast<std::size_t>(count));
  }
  CheckWritable(out, static_cast<std::size_t>(count));
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
  std::vector<float> line(static_cast<std::size_t>(from.cols + 2 * radius));  // with its mirrored ends
  float* const begin = line.data() + radius;
  std::vector<std::pair<int, int>> mirrored;  // pixel outside, and the one inside that it shows
  for (int x = 1; x <= radius; ++x) {
    for (const int outside : {-x, from.cols - 1 + x}) {
      mirrored.emplace_back(outside, cv::borderInterpolate(outside, from.cols, cv::BORDER_REFLECT_101));
    }
  }
  for (int y = 0; y < from.rows; ++y) {
    for (int i = 0; i <= radius; ++i) {
      const auto at = static_cast<std::size_t>(i);
      left[at] = from.ptr<float>(cv::borderInterpolate(y - i, from.rows, cv::BORDER_REFLECT_101));
      right[at] = from.ptr<float>(cv::borderInterpolate(y + i, from.rows, cv::BORDER_REFLECT_101));
    }
    SymmetricSum(left.data(), right.data(), kernel.data(), kernel.size(), from.cols, begin);
    for (const auto& [outside, inside] : mirrored) begin[outside] = begin[inside];
    for (int i = 0; i <= radius; ++i) {
      left[static_cast<std::size_t>(i)] = begin - i;
      right[static_cast<std::size_t>(i)] = begin + i;
    }
    SymmetricSum(left.data(), right.data(), kernel.data(), kernel.size(), from.cols, to.ptr<float>(y));
  }
}

}  // namespace tutti::internal
