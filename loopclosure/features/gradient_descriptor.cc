#include "core/numbers.h"
#include "loopclosure/features/whole_image.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace tutti {
namespace {

constexpr int kWidth = 64, kHeight = 48;  // of the thumbnail [px]
constexpr int kCell = 8;                  // side of a cell [px]
constexpr int kColumns = kWidth / kCell, kRows = kHeight / kCell;
constexpr int kBins = 9;                     // directions over half a turn
constexpr float kLeastThumbContrast = 0.5f;  // deviation of a thumbnail with something to see [grey levels]
constexpr float kPi = 3.14159265f;

using Histograms = std::vector<float>;  // by cell, then by direction

float& At(Histograms& histograms, int row, int column, int bin) {
  const int at = (row * kColumns + column) * kBins + bin;
  return histograms[internal::Index(at)];
}

// A pixel's gradient goes into the two next directions and the four next cells, each by its nearness.
void Vote(Histograms& histograms, float x, float y, float angle, float magnitude) {
  const float column = (x + 0.5f) / kCell - 0.5f, row = (y + 0.5f) / kCell - 0.5f;
  const float bin = angle / kPi * kBins - 0.5f;
  const int column0 = static_cast<int>(std::floor(column)), row0 = static_cast<int>(std::floor(row));
  const int bin0 = static_cast<int>(std::floor(bin));
  const float fx = column - static_cast<float>(column0), fy = row - static_cast<float>(row0);
  const float fb = bin - static_cast<float>(bin0);
  for (int corner = 0; corner < 8; ++corner) {
    const int dx = corner & 1, dy = (corner >> 1) & 1, db = corner >> 2;
    const int c = column0 + dx, r = row0 + dy;
    if (c < 0 || c >= kColumns || r < 0 || r >= kRows) continue;
    const float share = (dx != 0 ? fx : 1 - fx) * (dy != 0 ? fy : 1 - fy) * (db != 0 ? fb : 1 - fb);
    At(histograms, r, c, (bin0 + db + kBins) % kBins) += share * magnitude;
  }
}

// Each cell over the root mean square of those around it.
Histograms Relative(Histograms histograms) {
  Histograms relative(histograms.size());
  double all = 0;
  for (const float value : histograms) all += static_cast<double>(value) * value;
  const double least = 1e-3 * all / (kColumns * kRows);
  for (int r = 0; r < kRows; ++r) {
    for (int c = 0; c < kColumns; ++c) {
      double around = 0;
      int cells = 0;
      for (int y = std::max(0, r - 1); y <= std::min(kRows - 1, r + 1); ++y) {
        for (int x = std::max(0, c - 1); x <= std::min(kColumns - 1, c + 1); ++x, ++cells) {
          for (int b = 0; b < kBins; ++b) around += std::pow(static_cast<double>(At(histograms, y, x, b)), 2);
        }
      }
      const double scale = 1.0 / std::sqrt(around / cells + least + 1e-12);
      for (int b = 0; b < kBins; ++b) {
        At(relative, r, c, b) = static_cast<float>(std::sqrt(At(histograms, r, c, b) * scale));
      }
    }
  }
  return relative;
}

}  // namespace

cv::Mat WithoutMasked(const cv::Mat& image, const cv::Mat& mask) {
  if (mask.empty() || mask.size() != image.size()) return image;
  if (cv::countNonZero(mask) == 0) return {};
  cv::Mat seen = image.clone();
  seen.setTo(cv::mean(image, mask), mask == 0);
  return seen;
}

cv::Mat NormalisedDescriptor(const cv::Mat& descriptor) {
  if (descriptor.empty()) return {};
  const double length = cv::norm(descriptor);
  if (!(length > 1e-12) || !std::isfinite(length)) return {};
  return descriptor / length;
}

cv::Mat DescribeByGradients(const cv::Mat& grey, const cv::Mat& mask) {
  if (grey.empty() || grey.type() != CV_8UC1 || std::min(grey.rows, grey.cols) < kMinSide) return {};
  const cv::Mat seen = WithoutMasked(grey, mask);
  if (seen.empty()) return {};
  cv::Mat small;
  cv::resize(seen, small, cv::Size(kWidth, kHeight), 0, 0, cv::INTER_AREA);
  small.convertTo(small, CV_32F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(small, mean, deviation);
  if (!(deviation[0] >= static_cast<double>(kLeastThumbContrast))) return {};
  cv::Mat dx, dy;
  cv::Sobel(small, dx, CV_32F, 1, 0, 1);
  cv::Sobel(small, dy, CV_32F, 0, 1, 1);
  Histograms histograms(internal::Index(kColumns * kRows * kBins), 0.0f);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const float gx = dx.at<float>(y, x), gy = dy.at<float>(y, x);
      float angle = std::atan2(gy, gx);
      if (angle < 0) angle += kPi;
      Vote(histograms, static_cast<float>(x), static_cast<float>(y), angle, std::hypot(gx, gy));
    }
  }
  histograms = Relative(std::move(histograms));
  return NormalisedDescriptor(cv::Mat(1, static_cast<int>(histograms.size()), CV_32F, histograms.data()));
}

}  // namespace tutti
