#include "frontend/features/features.h"
#include "tests/support/rendered_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#include <tuple>

namespace tutti {
namespace {

constexpr int kBorder = 19;

cv::Mat TownImage(int frame) {
  SyntheticOptions options;
  options.width = 480;
  options.height = 240;
  return testing::RenderedWorld(options).Render(frame).image;
}

// Strong texture at the left, weak in the middle, none at the right.
cv::Mat Uneven(int seed) {
  cv::RNG random(static_cast<std::uint64_t>(seed));
  cv::Mat noise(200, 300, CV_8UC1), image;
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  cv::GaussianBlur(noise, image, cv::Size(5, 5), 1.2);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double contrast = x < 100 ? 1 : x < 200 ? 0.3 : 0;
      image.at<std::uint8_t>(y, x) =
          cv::saturate_cast<std::uint8_t>(128 + contrast * (image.at<std::uint8_t>(y, x) - 128));
    }
  }
  return image;
}

// What the header says, word by word: all corners at the lower threshold, sorted, then cell by cell.
std::vector<cv::KeyPoint> ByTheBook(const cv::Mat& image, const CornerOptions& options) {
  const cv::Size size(image.cols - 2 * options.border, image.rows - 2 * options.border);
  std::vector<cv::KeyPoint> corners, out;
  const cv::Rect seen(options.border - 3, options.border - 3, size.width + 6, size.height + 6);
  cv::FAST(image(seen), corners, options.threshold_min, true);
  const auto border = static_cast<float>(options.border);
  for (cv::KeyPoint& k : corners) k.pt += cv::Point2f(border - 3, border - 3);
  const auto wanted = static_cast<std::size_t>(options.wanted);
  if (corners.size() <= wanted) return corners;
  std::sort(corners.begin(), corners.end(), [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return std::tuple(-a.response, a.pt.y, a.pt.x) < std::tuple(-b.response, b.pt.y, b.pt.x);
  });
  const double cell = std::max(8.0, std::sqrt(double(size.area()) / std::max(1, options.wanted)) * 1.2);
  const int columns = static_cast<int>(std::ceil(size.width / cell)),
            rows = static_cast<int>(std::ceil(size.height / cell));
  std::vector<std::size_t> in_cell(static_cast<std::size_t>(rows * columns), 0), round(corners.size());
  std::size_t last = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const int c = std::min(columns - 1, static_cast<int>((corners[i].pt.x - border) / cell));
    const int r = std::min(rows - 1, static_cast<int>((corners[i].pt.y - border) / cell));
    std::size_t& count = in_cell.at(static_cast<std::size_t>(r) * static_cast<std::size_t>(columns) +
                                    static_cast<std::size_t>(c));
    const bool crowded_out = count > 0 && corners[i].response < static_cast<float>(options.threshold);
    round[i] = crowded_out ? corners.size() : count++;
    if (!crowded_out) last = std::max(last, round[i]);
  }
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k <= last; ++k) {
    for (std::size_t i = 0; i < corners.size() && chosen.size() < wanted; ++i) {
      if (round[i] == k) chosen.push_back(i);
    }
  }
  std::sort(chosen.begin(), chosen.end());
  for (const std::size_t i : chosen) out.push_back(corners[i]);
  return out;
}

void ExpectSameCorners(const std::vector<cv::KeyPoint>& found, const std::vector<cv::KeyPoint>& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_EQ(found[i].pt, expected[i].pt) << i;
    EXPECT_EQ(found[i].response, expected[i].response) << i;
  }
}

TEST(CornerDetector, FindsWhatAllCornersSortedAndSpreadWouldBe) {
  int several = 0;
  for (const int seed : {1, 2, 3}) {
    for (const cv::Mat& image : {Uneven(seed), TownImage(seed)}) {
      for (const int wanted : {0, 1, 30, 150, 400, 1500}) {
        const CornerOptions options{wanted, 20, 7, kBorder};
        const std::vector<cv::KeyPoint> found = DetectCorners(image, options);
        ExpectSameCorners(found, ByTheBook(image, options));
        several += found.size() > 20 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(several, 20);
}

TEST(CornerDetector, WeakCornersOnlyWhereACellHasNothingElse) {
  const CornerOptions options{60, 20, 7, kBorder};
  const std::vector<cv::KeyPoint> corners = DetectCorners(Uneven(5), options);
  int weak_left = 0, weak_middle = 0;
  for (const cv::KeyPoint& k : corners) {
    if (k.response >= 20) continue;
    weak_left += k.pt.x < 90 ? 1 : 0;
    weak_middle += k.pt.x > 100 && k.pt.x < 200 ? 1 : 0;
  }
  EXPECT_GT(weak_middle, 5);
  EXPECT_LT(4 * weak_left, weak_middle);
}

TEST(CornerDetector, OneThresholdIsEnough) {
  const CornerOptions options{100, 20, 20, kBorder};
  ExpectSameCorners(DetectCorners(Uneven(2), options), ByTheBook(Uneven(2), options));
}

TEST(CornerDetector, NoneUnderTheMaskAndAsManyBesideIt) {
  const cv::Mat image = TownImage(2);
  cv::Mat mask(image.size(), CV_8UC1, cv::Scalar(255));
  const int middle = image.rows / 2;
  const auto half = static_cast<float>(middle);
  mask.rowRange(0, middle).setTo(0);
  const CornerOptions options{150, 20, 7, kBorder};
  const std::vector<cv::KeyPoint> found = DetectCorners(image, options, mask);
  for (const cv::KeyPoint& k : found) EXPECT_GE(k.pt.y, half);
  std::size_t beside = 0;
  for (const cv::KeyPoint& k : DetectCorners(image, options)) beside += k.pt.y >= half ? 1 : 0;
  EXPECT_GE(found.size(), beside);  // those under the mask take nobody's place
  mask.setTo(1);
  ExpectSameCorners(DetectCorners(image, options, mask), DetectCorners(image, options));
}

TEST(CornerDetector, NothingInImagesThatAreBlankOrSmall) {
  const CornerOptions options{100, 20, 7, kBorder};
  EXPECT_TRUE(DetectCorners(cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)), options).empty());
  for (const int side : {1, 7, 2 * kBorder, 2 * kBorder + 1, 2 * kBorder + 2}) {
    EXPECT_TRUE(DetectCorners(cv::Mat(side, side, CV_8UC1, cv::Scalar(90)), options).empty()) << side;
  }
}

}  // namespace
}  // namespace tutti
