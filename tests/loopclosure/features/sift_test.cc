// Values of SIFT's points and descriptors: against OpenCV, and where they can be computed by hand.
#include "loopclosure/features/sift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <set>
#include <vector>

#include "loopclosure/features/sift_descriptor.h"

namespace tutti::internal {
namespace {

constexpr float kScale = 3.0f;      // of the points on ramps [px]
const cv::Point2f kCentre(40, 40);  // theirs
constexpr int kSide = 81;           // of the images of ramps [px]
constexpr double kLongest = 512;    // length of a descriptor

double Apart(double a_deg, double b_deg) { return std::abs(std::remainder(a_deg - b_deg, 360.0)); }

// Structure of every size and no symmetry, which would leave the orientation to rounding.
cv::Mat Clouds() {
  cv::Mat sum = cv::Mat::zeros(243, 321, CV_32F);
  std::mt19937 generator(5);
  for (const double size : {1.0, 2.0, 4.0, 8.0, 16.0}) {
    cv::Mat noise(sum.size(), CV_32F);
    for (int y = 0; y < noise.rows; ++y) {
      for (int x = 0; x < noise.cols; ++x) noise.at<float>(y, x) = static_cast<float>(generator() % 1000);
    }
    cv::GaussianBlur(noise, noise, cv::Size(0, 0), size);
    sum += size * noise;
  }
  cv::normalize(sum, sum, 0, 255, cv::NORM_MINMAX, CV_8U);
  return sum;
}

// OpenCV's first octave is of the image enlarged twice: ours gets the same, to start from the same values.
class SiftOfOpenCv : public ::testing::Test {
 protected:
  SiftOfOpenCv() {
    const cv::Mat image = Clouds();
    // OpenCV rounds half of the contrast down to whole grey levels: here it is one.
    const double contrast = 1.0001 * 2 * 3 / 255.0;
    cv::SIFT::create(0, 3, contrast)
        ->detectAndCompute(image, cv::noArray(), theirs_.keypoints, theirs_.descriptors);
    cv::Mat large;
    image.convertTo(large, CV_32F);
    cv::resize(large, large, cv::Size(), 2, 2, cv::INTER_LINEAR);
    ExtractionOptions options;
    options.features = 100000;
    options.sift_contrast = options.sift_min_contrast = contrast;
    SiftScratch scratch;
    ours_ = ExtractSift(large, 1.0, options, scratch);
    for (cv::KeyPoint& keypoint : ours_.keypoints) {
      keypoint.pt *= 0.5f;
      keypoint.size *= 0.5f;
    }
  }

  static bool IsSamePlace(const cv::KeyPoint& ours, const cv::KeyPoint& theirs) {
    return cv::norm(ours.pt - theirs.pt) < 0.03 * theirs.size &&
           std::abs(ours.size / theirs.size - 1) < 0.03 &&
           std::abs(ours.response / (255 * theirs.response) - 1) < 0.03;
  }

  // Position among OpenCV's points of the one that is the same, -1 if there is none.
  int InTheirs(const cv::KeyPoint& ours) const {
    const auto same =
        std::find_if(theirs_.keypoints.begin(), theirs_.keypoints.end(), [&](const cv::KeyPoint& theirs) {
          return IsSamePlace(ours, theirs) && Apart(ours.angle, theirs.angle) < 3;
        });
    return same == theirs_.keypoints.end() ? -1 : static_cast<int>(same - theirs_.keypoints.begin());
  }

  Features ours_, theirs_;
};

// Share of `some` that `found` finds.
double ShareFound(const std::vector<cv::KeyPoint>& some,
                  const std::function<bool(const cv::KeyPoint&)>& found) {
  return static_cast<double>(std::count_if(some.begin(), some.end(), found)) /
         static_cast<double>(some.size());
}

// But for a few at a bound: OpenCV's kernels reach over 4 standard deviations, ours over 3.
TEST_F(SiftOfOpenCv, FindsTheSamePlacesScalesAndContrasts) {
  const auto& ours = ours_.keypoints;
  const auto& theirs = theirs_.keypoints;
  ASSERT_GT(theirs.size(), 2500u);
  const auto in_theirs = [&](const cv::KeyPoint& a) {
    return std::any_of(theirs.begin(), theirs.end(),
                       [&](const cv::KeyPoint& b) { return IsSamePlace(a, b); });
  };
  const auto in_ours = [&](const cv::KeyPoint& b) {
    return std::any_of(ours.begin(), ours.end(), [&](const cv::KeyPoint& a) { return IsSamePlace(a, b); });
  };
  EXPECT_GT(ShareFound(ours, in_theirs), 0.98);
  EXPECT_GT(ShareFound(theirs, in_ours), 0.975);
}

TEST_F(SiftOfOpenCv, FindsTheSameOrientations) {
  std::set<int> found;
  for (const cv::KeyPoint& point : ours_.keypoints) found.insert(InTheirs(point));
  found.erase(-1);
  const auto same = static_cast<double>(found.size());
  EXPECT_GT(same / static_cast<double>(ours_.keypoints.size()), 0.975);
  EXPECT_GT(same / static_cast<double>(theirs_.keypoints.size()), 0.972);
}

// Ours samples each point's surroundings at as many places for all scales, and not around the nearest whole
// pixel.
TEST_F(SiftOfOpenCv, DescribesThePointsAlmostAlike) {
  double sum = 0, least = 1;
  int points = 0;
  for (std::size_t i = 0; i < ours_.keypoints.size(); ++i) {
    const int k = InTheirs(ours_.keypoints[i]);
    if (k < 0) continue;
    const cv::Mat a = ours_.descriptors.row(static_cast<int>(i)), b = theirs_.descriptors.row(k);
    const double cosine = a.dot(b) / (cv::norm(a) * cv::norm(b));
    sum += cosine;
    least = std::min(least, cosine);
    ++points;
  }
  EXPECT_GT(sum / points, 0.995);
  EXPECT_GT(least, 0.97);
}

// Grey levels that rise by one a pixel towards a direction [deg, counter-clockwise].
cv::Mat RampTowards(double direction_deg) {
  const double radians = direction_deg * CV_PI / 180;
  cv::Mat image(kSide, kSide, CV_32F);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      image.at<float>(y, x) = static_cast<float>(std::cos(radians) * x - std::sin(radians) * y);
    }
  }
  return image;
}

TEST(SiftOrientations, OfARampIsItsDirection) {
  for (int direction = 0; direction < 360; direction += 10) {
    const std::vector<float> angles = SiftOrientations(RampTowards(direction), kCentre, kScale);
    ASSERT_EQ(angles.size(), 1u) << direction;
    EXPECT_LT(Apart(angles[0], direction), 0.01) << direction;
  }
}

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
  EXPECT_LT(Apart(both[0], 0), 0.01);
  EXPECT_LT(Apart(both[1], 180), 0.01);
}

// Share of a row or column of cells, -1.5 to 1.5 from the middle, in what lies under a window of a standard
// deviation of two cells; each place is shared by the two cells beside it.
double ShareOfCells(double middle) {
  constexpr double kStep = 1e-3;
  double sum = 0;
  for (double x = middle - 1 + 0.5 * kStep; x < middle + 1; x += kStep) {
    sum += kStep * (1 - std::abs(x - middle)) * std::exp(-x * x / (2 * 2 * 2));
  }
  return sum;
}

// Of a ramp that rises `turn_deg` counter-clockwise of a point's orientation: in all cells the same two
// directions.
std::vector<double> DescriptorOfARamp(double turn_deg) {
  std::vector<double> values(kSiftValues, 0.0);
  const double direction = turn_deg / 45;
  const auto before = static_cast<std::size_t>(direction);
  const double after = direction - static_cast<double>(before);
  for (std::size_t cell = 0; cell < 16; ++cell) {
    const std::size_t row = cell / 4, column = cell % 4;
    const double weight =
        ShareOfCells(static_cast<double>(column) - 1.5) * ShareOfCells(static_cast<double>(row) - 1.5);
    values[8 * cell + before % 8] += weight * (1 - after);
    values[8 * cell + (before + 1) % 8] += weight * after;
  }
  const auto stretch = [&](double length) {
    const double now = cv::norm(values);
    for (double& value : values) value *= length / now;
  };
  stretch(1.0);
  for (double& value : values) value = std::min(value, 0.2);
  stretch(kLongest);
  return values;
}

TEST(SiftDescriptor, OfARampIsTheWindowInTwoDirectionsOfEveryCell) {
  for (const double orientation : {0.0, 37.0, 200.0}) {
    for (const double turn : {0.0, 22.5, 60.0, 135.0, 300.0, 341.0}) {
      std::array<float, kSiftValues> ours{};
      // cv::KeyPoint's angle is clockwise.
      DescribeSift(RampTowards(orientation + turn), kCentre, kScale, static_cast<float>(360 - orientation),
                   ours.data());
      const std::vector<double> expected = DescriptorOfARamp(turn);
      double worst = 0;
      for (std::size_t i = 0; i < kSiftValues; ++i) worst = std::max(worst, std::abs(ours[i] - expected[i]));
      EXPECT_LT(worst, 2.0);
    }
  }
}

}  // namespace
}  // namespace tutti::internal
