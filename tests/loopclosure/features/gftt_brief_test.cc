// Corners and their descriptors by comparisons of pixels.
#include <gtest/gtest.h>

#include <bitset>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "tests/loopclosure/features/textured_image.h"
#include "tutti/loopclosure/features.h"

namespace tutti {
namespace {

cv::Mat BriefAt(const cv::Mat& image, const cv::Point2f& at) {
  std::vector<cv::KeyPoint> keypoints = {cv::KeyPoint(at, 48)};
  cv::Mat descriptors;
  CreateGfttBrief(10)->compute(image, keypoints, descriptors);
  return descriptors;
}

int Bits(const cv::Mat& descriptor) { return static_cast<int>(cv::norm(descriptor, cv::NORM_HAMMING)); }

// Which pixels are compared shows where a single one is darker or brighter than all others: of the pairs that
// have it as first or as second.
struct Moments {
  double count = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0;
  void Add(double weight, double dx, double dy) {
    count += weight, x += weight * dx, y += weight * dy;
    xx += weight * dx * dx, yy += weight * dy * dy, xy += weight * dx * dy;
  }
};

Moments ComparedPixels(bool first) {
  constexpr int kMiddle = 40;
  Moments moments;
  for (int y = -30; y <= 30; y += 2) {
    for (int x = -30; x <= 30; x += 2) {
      cv::Mat image(81, 81, CV_8UC1, cv::Scalar(first ? 255 : 0));
      image.at<std::uint8_t>(kMiddle + y, kMiddle + x) = first ? 0 : 255;
      moments.Add(Bits(BriefAt(image, {kMiddle, kMiddle})), x, y);
    }
  }
  return moments;
}

// An isotropic Gaussian with a fifth of the patch of 48 px (Calonder et al., G II), and no pixel beyond it.
TEST(GfttBrief, ComparesPixelsThatAreSpreadAsThePaperSays) {
  for (const bool first : {true, false}) {
    const Moments m = ComparedPixels(first);
    EXPECT_GT(m.count, 256);
    EXPECT_NEAR(m.x / m.count, 0, 1.5);
    EXPECT_NEAR(m.y / m.count, 0, 1.5);
    EXPECT_NEAR(std::sqrt(m.xx / m.count), 48.0 / 5, 1.2);
    EXPECT_NEAR(std::sqrt(m.yy / m.count), 48.0 / 5, 1.2);
    EXPECT_NEAR(m.xy / m.count, 0, 12);
  }
}

TEST(GfttBrief, OfTheImageWithDarkForBrightEveryBitIsTheOther) {
  cv::Mat image(150, 200, CV_8UC1);
  cv::RNG(3).fill(image, cv::RNG::UNIFORM, 0, 256);
  const cv::Mat inverted = 255 - image;
  int equal = 0;
  for (const cv::Point2f& at : {cv::Point2f(100, 70), cv::Point2f(60.4f, 90.6f), cv::Point2f(130, 50)}) {
    const int same =
        256 - static_cast<int>(cv::norm(BriefAt(image, at), BriefAt(inverted, at), cv::NORM_HAMMING));
    equal += same;  // pairs of one value
  }
  EXPECT_LT(equal, 60);
}

TEST(GfttBrief, AtTheBorderSeesTheImageMirrored) {
  const cv::Mat image = testing::TexturedImage(4, 200, 150);
  cv::Mat larger;
  cv::copyMakeBorder(image, larger, 40, 40, 40, 40, cv::BORDER_REFLECT_101);
  for (const cv::Point2f& at : {cv::Point2f(0, 0), cv::Point2f(199, 149), cv::Point2f(3, 140)}) {
    const double other =
        cv::norm(BriefAt(image, at), BriefAt(larger, at + cv::Point2f(40, 40)), cv::NORM_HAMMING);
    EXPECT_LE(other, 4) << at;
  }
  EXPECT_EQ(cv::norm(BriefAt(image, {-5, 300}), BriefAt(image, {0, 149}), cv::NORM_HAMMING), 0) << "outside";
}

TEST(GfttBrief, CornersAreApartAndStrongAndWhereTheMaskIs) {
  const cv::Mat image = testing::TexturedImage(5, 320, 240);
  cv::Mat mask(image.size(), CV_8UC1, cv::Scalar(255));
  mask.colRange(0, 160).setTo(0);
  std::vector<cv::KeyPoint> all, some;
  CreateGfttBrief(500)->detect(image, all);
  CreateGfttBrief(20)->detect(image, some, mask);
  ASSERT_GT(all.size(), 200u);
  ASSERT_EQ(some.size(), 20u);
  for (const cv::KeyPoint& k : some) EXPECT_GE(k.pt.x, 160);
  cv::Mat strength;
  cv::cornerMinEigenVal(image, strength, 3);
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].response, strength.at<float>(cv::Point(all[i].pt)));
    for (std::size_t k = 0; k < i; ++k) EXPECT_GE(cv::norm(all[i].pt - all[k].pt), 5);
  }
  cv::Mat faint(image.size(), CV_8UC1, cv::Scalar(100));
  faint.colRange(100, 200).rowRange(100, 200).setTo(101);
  CreateGfttBrief(500)->detect(faint, all);
  EXPECT_TRUE(all.empty()) << "corners of one grey level";
}

}  // namespace
}  // namespace tutti
