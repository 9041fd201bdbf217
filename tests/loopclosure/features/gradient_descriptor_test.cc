// Values of the descriptor by gradients, on images of its own size: nothing is scaled.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>

#include "loopclosure/features/whole_image.h"

namespace tutti {
namespace {

constexpr int kWidth = 64, kHeight = 48;
constexpr int kCell = 8;
constexpr int kRows = kHeight / kCell, kColumns = kWidth / kCell;
constexpr int kBins = 9;  // of 20 degrees

// Grey levels that rise by so many a pixel to the right and down, around the middle of all levels.
cv::Mat GreyRamp(int right, int down) {
  cv::Mat image(kHeight, kWidth, CV_8UC1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      image.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(128 + right * (x - kWidth / 2) + down * (y - kHeight / 2));
    }
  }
  return image;
}

float ValueOf(const cv::Mat& descriptor, int row, int column, int bin) {
  return descriptor.at<float>((row * kColumns + column) * kBins + bin);
}

// Values are roots of shares of the gradient: the share of each direction in a cell.
std::array<double, kBins> Shares(const cv::Mat& descriptor, int row, int column) {
  std::array<double, kBins> shares{};
  double sum = 0;
  for (int b = 0; b < kBins; ++b) sum += std::pow(ValueOf(descriptor, row, column, b), 2);
  for (int b = 0; b < kBins; ++b)
    shares[static_cast<std::size_t>(b)] = std::pow(ValueOf(descriptor, row, column, b), 2) / sum;
  return shares;
}

// Directions are over half a turn, from the right downwards, and the middle of the first is at 10 degrees.
TEST(GradientDescriptor, SharesADirectionBetweenTheTwoNearestOfNine) {
  struct Case {
    int right, down;
    double first_bin;  // of the two, and how far the direction lies beyond its middle, in bins
  };
  const double steep = std::atan2(2.0, 1.0) / CV_PI * kBins - 0.5;
  for (const auto& [right, down, bin] : {Case{3, 0, 8.5}, Case{-3, 0, 8.5}, Case{0, 4, 4.0}, Case{0, -4, 4.0},
                                         Case{2, 2, 1.75}, Case{-2, -2, 1.75}, Case{2, -2, 6.25},
                                         Case{-2, 2, 6.25}, Case{1, 2, steep}, Case{-1, 2, 8 - steep}}) {
    const cv::Mat descriptor = DescribeByGradients(GreyRamp(right, down));
    ASSERT_EQ(descriptor.cols, kRows * kColumns * kBins);
    std::array<double, kBins> expected{};
    const int before = static_cast<int>(bin);
    expected[static_cast<std::size_t>(before)] = before + 1 - bin;
    expected[static_cast<std::size_t>((before + 1) % kBins)] += bin - before;
    // At the border of the image there is no gradient across it.
    for (int r = 1; r < kRows - 1; ++r) {
      for (int c = 1; c < kColumns - 1; ++c) {
        const std::array<double, kBins> shares = Shares(descriptor, r, c);
        for (std::size_t b = 0; b < kBins; ++b)
          EXPECT_NEAR(shares[b], expected[b], 1e-5) << right << ", " << down << ": bin " << b;
      }
    }
  }
}

// How much of the gradient each cell along one side of the image gets: each pixel is shared by the two cells
// whose middles are beside it, and beyond the first and last middle one alone gets a part.
cv::Mat Amounts(const std::vector<double>& gradient) {
  cv::Mat amounts = cv::Mat::zeros(static_cast<int>(gradient.size()) / kCell, 1, CV_64F);
  for (int cell = 0; cell < amounts.rows; ++cell) {
    for (std::size_t i = 0; i < gradient.size(); ++i) {
      const double away = std::abs((static_cast<double>(i) + 0.5) / kCell - (cell + 0.5));
      amounts.at<double>(cell) += std::max(0.0, 1 - away) * gradient[i];
    }
  }
  return amounts;
}

// Each value is the root of what its cell has over the root mean square of the cells around it, itself one of
// them; a thousandth of the mean of all is added, for cells around which nothing is.
cv::Mat Expected(const cv::Mat& cells) {
  const double least = 1e-3 * cells.dot(cells) / cells.total();
  cv::Mat values(cells.size(), CV_64F);
  for (int r = 0; r < cells.rows; ++r) {
    for (int c = 0; c < cells.cols; ++c) {
      const cv::Mat around = cells(cv::Range(std::max(0, r - 1), std::min(cells.rows, r + 2)),
                                   cv::Range(std::max(0, c - 1), std::min(cells.cols, c + 2)));
      const double mean_square = around.dot(around) / around.total();
      values.at<double>(r, c) = std::sqrt(cells.at<double>(r, c) / std::sqrt(mean_square + least));
    }
  }
  return values / cv::norm(values);
}

// Bands across the image, of which one rises steeply, one gently, and two not but for a single step.
TEST(GradientDescriptor, CellsShareThePixelsBetweenThemAndCountAgainstTheirNeighbours) {
  cv::Mat image(kHeight, kWidth, CV_8UC1);
  std::vector<int> level = {20};
  for (int y = 1; y < kHeight; ++y)
    level.push_back(level.back() + (y < 12 ? 9 : y < 20 ? 2 : y == 42 ? 1 : 0));
  std::vector<double> down(kHeight, 0.0);  // none across the border
  for (int y = 0; y < kHeight; ++y) {
    const auto i = static_cast<std::size_t>(y);
    image.row(y).setTo(level[i]);
    if (y > 0 && y + 1 < kHeight) down[i] = level[i + 1] - level[i - 1];
  }
  const cv::Mat cells = Amounts(down) * Amounts(std::vector<double>(kWidth, 1.0)).t();
  const cv::Mat expected = Expected(cells), descriptor = DescribeByGradients(image);
  EXPECT_GT(expected.at<double>(kRows - 1, 3), 0.5 * expected.at<double>(0, 3)) << "faint, but there alone";
  for (int r = 0; r < kRows; ++r) {
    for (int c = 0; c < kColumns; ++c)
      EXPECT_NEAR(ValueOf(descriptor, r, c, 4), expected.at<double>(r, c), 1e-5) << r << ", " << c;
  }
}

// The darker half is not quite even: the edge between the halves alone would be the same everywhere.
cv::Mat HalvesOf(int dark, int bright) {
  cv::Mat image(kHeight, kWidth, CV_8UC1, cv::Scalar(dark));
  image.colRange(kWidth / 2, kWidth).setTo(bright);
  image(cv::Rect(3, 5, 11, 7)).setTo(bright);
  image(cv::Rect(20, 30, 2, 2)).setTo(bright);
  return image;
}

TEST(GradientDescriptor, IsTheSameForAFaintImageAsForAStrongOne) {
  const cv::Mat faint = DescribeByGradients(HalvesOf(100, 102)),
                strong = DescribeByGradients(HalvesOf(0, 250));
  EXPECT_LT(cv::norm(faint, strong, cv::NORM_INF), 1e-6);
  EXPECT_FALSE(DescribeByGradients(HalvesOf(100, 102)).empty());
  EXPECT_TRUE(DescribeByGradients(GreyRamp(0, 0)).empty());
}

// Half and half of two levels that are one apart deviate by a half, a quarter and the rest by 0.43.
TEST(GradientDescriptor, NeedsADeviationOfHalfAGreyLevel) {
  cv::Mat image(kHeight, kWidth, CV_8UC1, cv::Scalar(100));
  image.colRange(0, kWidth / 2).setTo(101);
  EXPECT_FALSE(DescribeByGradients(image).empty());
  image.colRange(0, kWidth / 4).setTo(100);
  EXPECT_TRUE(DescribeByGradients(image).empty());
}

}  // namespace
}  // namespace tutti
