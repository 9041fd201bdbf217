#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <random>

#include "tutti/loopclosure/features.h"

namespace tutti {
namespace {

constexpr int kPairs = 256;
constexpr int kPatch = 48;       // side of the patch that is described [px]
constexpr double kSmooth = 2.0;  // standard deviation of the Gaussian before pixels are compared [px]
constexpr int kHalf = kPatch / 2;
constexpr int kApart = 5;           // corners are no nearer to each other [px]
constexpr double kQuality = 0.001;  // of the best corner, below which there is none
constexpr double kLeastCorner =
    1e-4;  // smaller eigenvalue below which there is no corner, as cv::cornerMinEigenVal
constexpr int kCornerBlock = 3;  // window of a corner [px]

struct Pair {
  cv::Point a;
  cv::Point b;
};

// Offsets drawn from an isotropic Gaussian with a fifth of the patch as standard deviation (the paper's G
// II). The sum of twelve uniform numbers stands in for it: the same on every platform.
const std::array<Pair, kPairs>& Pattern() {
  static const std::array<Pair, kPairs> pattern = [] {
    std::mt19937 generator(1);
    const auto draw = [&] {
      double sum = -6.0;
      for (int i = 0; i < 12; ++i) sum += static_cast<double>(generator()) / 4294967296.0;
      return std::clamp(static_cast<int>(std::lround(sum * kPatch / 5.0)), -kHalf, kHalf);
    };
    std::array<Pair, kPairs> pairs;
    for (Pair& pair : pairs) {
      do {
        pair.a.x = draw();
        pair.a.y = draw();
        pair.b.x = draw();
        pair.b.y = draw();
      } while (pair.a == pair.b);
    }
    return pairs;
  }();
  return pattern;
}

class GfttBrief : public cv::Feature2D {
 public:
  explicit GfttBrief(int max_features) : max_features_(max_features) {}

  void detectAndCompute(cv::InputArray image, cv::InputArray mask, std::vector<cv::KeyPoint>& keypoints,
                        cv::OutputArray descriptors, bool use_provided) override {
    const cv::Mat grey = image.getMat();
    CV_Assert(grey.type() == CV_8UC1);
    if (!use_provided) Detect(grey, mask.getMat(), keypoints);
    if (descriptors.needed()) Describe(grey, keypoints, descriptors);
  }

  int descriptorSize() const override { return kPairs / 8; }
  int descriptorType() const override { return CV_8U; }
  int defaultNorm() const override { return cv::NORM_HAMMING; }
  cv::String getDefaultName() const override { return "tutti.GfttBrief"; }

 private:
  void Detect(const cv::Mat& grey, const cv::Mat& mask, std::vector<cv::KeyPoint>& keypoints) const {
    keypoints.clear();
    cv::Mat strength;
    cv::cornerMinEigenVal(grey, strength, kCornerBlock);
    std::vector<cv::Point2f> corners;
    cv::goodFeaturesToTrack(grey, corners, max_features_, kQuality, kApart, mask, kCornerBlock);
    for (const cv::Point2f& corner : corners) {
      const float response = strength.at<float>(cvRound(corner.y), cvRound(corner.x));
      if (static_cast<double>(response) < kLeastCorner) continue;
      keypoints.emplace_back(corner, static_cast<float>(kPatch), -1.0f, response);
    }
  }

  static void Describe(const cv::Mat& grey, const std::vector<cv::KeyPoint>& keypoints,
                       cv::OutputArray descriptors) {
    cv::Mat smooth;
    cv::GaussianBlur(grey, smooth, cv::Size(), kSmooth);
    cv::copyMakeBorder(smooth, smooth, kHalf, kHalf, kHalf, kHalf, cv::BORDER_REFLECT_101);
    const std::array<Pair, kPairs>& pattern = Pattern();
    descriptors.create(static_cast<int>(keypoints.size()), kPairs / 8, CV_8U);
    cv::Mat rows = descriptors.getMat();
    for (std::size_t i = 0; i < keypoints.size(); ++i) {
      const int x = std::clamp(cvRound(keypoints[i].pt.x), 0, grey.cols - 1) + kHalf;
      const int y = std::clamp(cvRound(keypoints[i].pt.y), 0, grey.rows - 1) + kHalf;
      auto* bytes = rows.ptr<std::uint8_t>(static_cast<int>(i));
      std::fill_n(bytes, kPairs / 8, std::uint8_t{0});
      for (std::size_t k = 0; k < pattern.size(); ++k) {
        const Pair& pair = pattern[k];
        const int a = smooth.ptr<std::uint8_t>(y + pair.a.y)[x + pair.a.x];
        const int b = smooth.ptr<std::uint8_t>(y + pair.b.y)[x + pair.b.x];
        if (a < b) bytes[k / 8] = static_cast<std::uint8_t>(bytes[k / 8] | (1u << (k % 8)));
      }
    }
  }

  int max_features_;
};

}  // namespace

cv::Ptr<cv::Feature2D> CreateGfttBrief(int max_features) { return cv::makePtr<GfttBrief>(max_features); }

}  // namespace tutti
