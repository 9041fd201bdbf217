// Orientations and descriptors of SIFT: where they can be computed by hand, and as the paper defines them.
#include "loopclosure/features/sift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "loopclosure/features/polar.h"
#include "tests/loopclosure/features/angles.h"

namespace tutti::internal {
namespace {

constexpr float kScale = 3.0f;      // of the point in the valley [px]
const cv::Point2f kCentre(40, 40);  // its place
constexpr int kSide = 81;           // of the image of the valley [px]
constexpr double kLongest = 512;    // length of a descriptor

using testing::AnglesApart;

// A valley that rises by one a pixel to the right, and by `other` to the left.
std::vector<float> OrientationsInAValley(float other) {
  cv::Mat image(kSide, kSide, CV_32F);
  for (int x = 0; x < kSide; ++x) {
    const float right = static_cast<float>(x) - kCentre.x;
    image.col(x).setTo(right > 0 ? right : -other * right);
  }
  return SiftOrientations(image, kCentre, kScale);
}

TEST(SiftOrientations, ASecondOneCountsFromFourFifthsOfTheFirst) {
  EXPECT_EQ(OrientationsInAValley(0.77f).size(), 1u);
  const std::vector<float> both = OrientationsInAValley(0.83f);
  ASSERT_EQ(both.size(), 2u);
  EXPECT_LT(AnglesApart(both[0], 0), 0.01);
  EXPECT_LT(AnglesApart(both[1], 180), 0.01);
}

// Values that have nothing to do with each other, so that each pixel's place and weight show.
cv::Mat Dots() {
  cv::Mat image(60, 70, CV_32F);
  std::mt19937 generator(11);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x)
      image.at<float>(y, x) = static_cast<float>(generator() % 100000) / 391;
  }
  return image;
}

// The gradient at a pixel as length and direction [deg, counter-clockwise].
struct GradientAt {
  GradientAt(const cv::Mat& image, int x, int y) {
    if (x < 1 || y < 1 || x > image.cols - 2 || y > image.rows - 2) return;
    const double dx = image.at<float>(y, x + 1) - image.at<float>(y, x - 1);
    const double up = image.at<float>(y - 1, x) - image.at<float>(y + 1, x);
    length = std::hypot(dx, up);
    direction = std::atan2(up, dx) * 180 / CV_PI;
  }
  double length = 0;  // 0 where a neighbour lies outside of the image
  double direction = 0;
};

// Lowe 2004, sections 5 and 6, pixel by pixel.
std::vector<double> OrientationsByDefinition(const cv::Mat& image, const cv::Point2f& at, double scale) {
  constexpr int kDirections = 36;
  const int radius = cvRound(4.5 * scale);
  std::array<double, kDirections> sums{}, smooth{};
  for (int v = -radius; v <= radius; ++v) {
    for (int u = -radius; u <= radius; ++u) {
      const GradientAt gradient(image, cvRound(at.x) + u, cvRound(at.y) + v);
      const int bin = (cvRound(gradient.direction / 10) + kDirections) % kDirections;
      sums[static_cast<std::size_t>(bin)] +=
          gradient.length * std::exp(-(u * u + v * v) / (2 * std::pow(1.5 * scale, 2)));
    }
  }
  const auto around = [](const std::array<double, kDirections>& values, int i) {
    return values[static_cast<std::size_t>((i + kDirections) % kDirections)];
  };
  for (int i = 0; i < kDirections; ++i) {
    for (int k = -2; k <= 2; ++k)
      smooth[static_cast<std::size_t>(i)] += std::array{6, 4, 1}[std::abs(k)] / 16.0 * around(sums, i + k);
  }
  std::vector<double> angles;
  for (int i = 0; i < kDirections; ++i) {
    const double before = around(smooth, i - 1), here = around(smooth, i), after = around(smooth, i + 1);
    if (here <= std::max(before, after) || here < 0.8 * *std::max_element(smooth.begin(), smooth.end()))
      continue;
    angles.push_back(10 * (i + 0.5 * (before - after) / (before - 2 * here + after)));
  }
  return angles;
}

// Points all over an image, some of which reach over its border.
std::vector<cv::Point2f> PlacesOn(const cv::Mat& image) {
  std::vector<cv::Point2f> places;
  for (float y = 5.3f; y < static_cast<float>(image.rows - 5); y += 7.7f) {
    for (float x = 5.6f; x < static_cast<float>(image.cols - 5); x += 8.3f) places.emplace_back(x, y);
  }
  return places;
}

// Directions on the border of a bin may fall to either side.
TEST(SiftOrientations, AreThoseOfTheDefinitionUpToTheBorder) {
  const cv::Mat image = Dots();
  int places = 0, same = 0;
  for (const float scale : {1.7f, 2.4f, 3.2f}) {
    for (const cv::Point2f& at : PlacesOn(image)) {
      const std::vector<float> ours = SiftOrientations(image, at, scale);
      const std::vector<double> expected = OrientationsByDefinition(image, at, scale);
      bool equal = ours.size() == expected.size();
      for (std::size_t i = 0; equal && i < ours.size(); ++i) equal = AnglesApart(ours[i], expected[i]) < 0.5;
      ++places;
      same += equal;
    }
  }
  EXPECT_GE(same, 0.97 * places) << "of " << places;
}

// What a sample adds to the descriptor: it is shared by the cells and directions that are nearest to it.
void AddSample(double x, double y, double length, double direction, std::vector<double>& values) {
  const auto share = [](double distance) { return std::max(0.0, 1 - std::abs(distance)); };
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      const double cell = share(x - (column - 1.5)) * share(y - (row - 1.5));
      for (int k = 0; k < 8; ++k) {
        const int at = 8 * (4 * row + column) + k;
        values[static_cast<std::size_t>(at)] +=
            length * cell * share(std::remainder(direction / 45 - k, 8.0));
      }
    }
  }
}

// 24 by 24 samples along five cells of three scales, at the nearest pixels.
std::vector<double> DescriptorByDefinition(const cv::Mat& image, const cv::Point2f& at, double scale,
                                           double orientation) {
  std::vector<double> values(kSiftValues, 0.0);
  const double radians = orientation * CV_PI / 180;
  for (int r = 0; r < 24; ++r) {
    for (int c = 0; c < 24; ++c) {
      const double x = (c - 11.5) * 5 / 24, y = (r - 11.5) * 5 / 24;  // in cells, y down
      const double across = 3 * scale * (std::cos(radians) * x + std::sin(radians) * y);
      const double down = 3 * scale * (-std::sin(radians) * x + std::cos(radians) * y);
      const GradientAt gradient(image, cvRound(at.x + across), cvRound(at.y + down));
      AddSample(x, y, gradient.length * std::exp(-(x * x + y * y) / 8), gradient.direction - orientation,
                values);
    }
  }
  const double clip = 0.2 * cv::norm(values);
  for (double& value : values) value = std::min(value, clip);
  const double length = cv::norm(values);
  for (double& value : values) value *= kLongest / length;
  return values;
}

// But for the few points of which a sample lies half-way between two pixels.
TEST(SiftDescriptor, IsThatOfTheDefinitionUpToTheBorder) {
  const cv::Mat image = Dots();
  int places = 0, same = 0;
  for (const double orientation : {33.0, 278.0}) {
    for (const cv::Point2f& at : PlacesOn(image)) {
      std::array<float, kSiftValues> ours{};
      DescribeSift(image, at, 2.1f, static_cast<float>(360 - orientation), ours.data());
      const std::vector<double> expected = DescriptorByDefinition(image, at, 2.1f, orientation);
      double worst = 0;
      for (std::size_t i = 0; i < kSiftValues; ++i) worst = std::max(worst, std::abs(ours[i] - expected[i]));
      ++places;
      same += worst < 1;
    }
  }
  EXPECT_GE(same, 0.97 * places) << "of " << places;
}

}  // namespace
}  // namespace tutti::internal

namespace tutti {
namespace {

TEST(Polar, LengthAndDirectionOfEveryDirection) {
  constexpr std::size_t kCount = 3601;
  std::vector<float> dx(internal::RoomForPolar(kCount)), dy(dx.size()), length(dx.size()), angle(dx.size());
  for (std::size_t i = 0; i < kCount; ++i) {
    const double direction = static_cast<double>(i) / 10.0 * M_PI / 180.0;
    const double r = 0.01 + static_cast<double>(i % 300);
    dx[i] = static_cast<float>(r * std::cos(direction));
    dy[i] = static_cast<float>(r * std::sin(direction));
  }
  internal::Polar(dx.data(), dy.data(), kCount, length.data(), angle.data());
  for (std::size_t i = 0; i < kCount; ++i) {
    const float r = 0.01f + static_cast<float>(i % 300);
    EXPECT_NEAR(length[i], r, 1e-5f * r);
    EXPECT_NEAR(std::remainder(angle[i] - static_cast<float>(i) / 10.0f, 360.0f), 0, 0.02f) << i;
    EXPECT_GE(angle[i], 0);
    EXPECT_LE(angle[i], 360);
  }
}

TEST(Polar, NoGradientHasNoLengthAndAFiniteDirection) {
  const std::vector<float> zero(4);
  std::vector<float> length(4, 1), angle(4, 1);
  internal::Polar(zero.data(), zero.data(), 1, length.data(), angle.data());
  EXPECT_EQ(length[0], 0);
  EXPECT_EQ(angle[0], 0);
}

}  // namespace
}  // namespace tutti
