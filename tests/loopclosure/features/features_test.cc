#include "tutti/loopclosure/features.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "core/parallel.h"
#include "loopclosure/geometry/matching.h"
#include "loopclosure/store/packed_mat.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tutti/core/error.h"
#include "tutti/loopclosure/detector_options.h"

namespace tutti {
namespace {

std::vector<cv::Point2f> Pixels(const Features& features) {
  std::vector<cv::Point2f> pixels;
  for (const cv::KeyPoint& keypoint : features.keypoints) pixels.push_back(keypoint.pt);
  return pixels;
}

class EveryMember : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Members, EveryMember, ::testing::ValuesIn(KnownFeatureTypes()));

TEST_P(EveryMember, FindsFeaturesAndMatchesThemWhenSeenAgain) {
  const FeatureExtractor extractor(GetParam(), ExtractionOptions());
  const cv::Mat image = testing::TexturedImage(1, 480, 360);
  const Features a = extractor.Extract(image);
  const Features b = extractor.Extract(testing::SeenAgain(image));
  ASSERT_GT(a.keypoints.size(), 100u);
  EXPECT_LE(a.keypoints.size(), 400u);
  EXPECT_EQ(a.descriptors.rows, static_cast<int>(a.keypoints.size()));
  EXPECT_GT(MatchDescriptors(b.descriptors, a.descriptors, Pixels(a), 0.8).size(), 40u);
}

TEST_P(EveryMember, ExtractsTheSameFromSeveralThreadsAtOnce) {
  const FeatureExtractor extractor(GetParam(), ExtractionOptions());
  std::vector<Features> results(6);
  RunParallel(6, 3, [&](int i) {
    results[static_cast<std::size_t>(i)] =
        extractor.Extract(testing::TexturedImage(static_cast<std::uint32_t>(i % 2), 320, 240));
  });
  for (std::size_t i = 2; i < results.size(); ++i) {
    ASSERT_EQ(results[i].keypoints.size(), results[i - 2].keypoints.size());
    EXPECT_EQ(cv::norm(results[i].descriptors, results[i - 2].descriptors, cv::NORM_INF), 0.0);
  }
}

TEST(FeatureExtractor, OrbsBorderGrowsWithTheImageUpToOpenCvsOwn) {
  const auto nearest_to_border = [&](int width, int height) {
    float nearest = 1e9f;
    const Features features = FeatureExtractor("orb", {}).Extract(testing::TexturedImage(4, width, height));
    for (const cv::Point2f& p : Pixels(features)) {
      nearest =
          std::min({nearest, p.x, p.y, static_cast<float>(width) - p.x, static_cast<float>(height) - p.y});
    }
    return nearest;
  };
  EXPECT_LT(nearest_to_border(320, 240), 20.0f);
  EXPECT_GE(nearest_to_border(800, 640), 30.0f);
}

TEST_P(EveryMember, HardImagesGiveNoFeaturesAndNoCrash) {
  const FeatureExtractor extractor(GetParam(), ExtractionOptions());
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(5, 200), cv::Size(17, 17), cv::Size(33, 20),
                              cv::Size(64, 48), cv::Size(3000, 20)}) {
    EXPECT_NO_THROW(extractor.Extract(testing::TexturedImage(2, size.width, size.height))) << size;
    EXPECT_TRUE(extractor.Extract(cv::Mat(size, CV_8UC1, cv::Scalar(128))).keypoints.empty()) << size;
  }
  EXPECT_TRUE(extractor.Extract(cv::Mat()).keypoints.empty());
}

TEST_P(EveryMember, HugeImagesAreScaledAndKeypointsScaledBack) {
  ExtractionOptions options;
  options.max_pixels = 320 * 240;
  cv::Mat image;
  cv::resize(testing::TexturedImage(4, 320, 240), image, cv::Size(), 4, 4, cv::INTER_NEAREST);
  const Features features = FeatureExtractor(GetParam(), options).Extract(image);
  ASSERT_GT(features.keypoints.size(), 50u);
  float right = 0;
  for (const cv::KeyPoint& keypoint : features.keypoints) right = std::max(right, keypoint.pt.x);
  EXPECT_GT(right, 900.0f);
  EXPECT_LT(right, 1280.0f);
}

TEST(Features, SmallImagesKeepTheUpperPyramidLevelsOfOrb) {
  const Features features =
      FeatureExtractor("orb", ExtractionOptions()).Extract(testing::TexturedImage(1, 240, 192));
  int top = 0;
  for (const cv::KeyPoint& keypoint : features.keypoints) top = std::max(top, keypoint.octave);
  EXPECT_GE(top, 4);
}

class DefaultMember : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Members, DefaultMember, ::testing::ValuesIn(LoopDetectorOptions().members));

// AVX2 and FMA, where the processor has them, or plain x86-64.
TEST_P(DefaultMember, InstructionsThatOpenCvMayUseChangeNoBit) {
  const FeatureExtractor extractor(GetParam(), ExtractionOptions());
  for (const cv::Size size : {cv::Size(1241, 376), cv::Size(240, 192), cv::Size(1500, 1100)}) {
    const cv::Mat image = testing::TexturedImage(6, size.width, size.height);
    const Features all = extractor.Extract(image);
    cv::setUseOptimized(false);
    const Features plain = extractor.Extract(image);
    cv::setUseOptimized(true);
    ASSERT_EQ(all.keypoints.size(), plain.keypoints.size()) << size;
    EXPECT_EQ(cv::norm(all.descriptors, plain.descriptors, cv::NORM_INF), 0) << size;
    for (std::size_t i = 0; i < all.keypoints.size(); ++i) {
      const cv::KeyPoint &a = all.keypoints[i], &b = plain.keypoints[i];
      EXPECT_TRUE(a.pt == b.pt && a.size == b.size && a.angle == b.angle && a.response == b.response)
          << size << " point " << i;
    }
  }
}

class QuotaMember : public ::testing::TestWithParam<std::string> {};
INSTANTIATE_TEST_SUITE_P(Members, QuotaMember, ::testing::Values("surf", "sift"));

TEST_P(QuotaMember, SmallImagesFillTheQuotaWithKeypointsInTheirOwnPixels) {
  cv::Mat image;  // as much to see as in a large one
  cv::resize(testing::TexturedImage(1, 640, 512), image, cv::Size(240, 192), 0, 0, cv::INTER_AREA);
  const Features features = FeatureExtractor(GetParam(), ExtractionOptions()).Extract(image);
  EXPECT_GE(features.keypoints.size(), 380u);
  float right = 0;
  float bottom = 0;
  for (const cv::Point2f& p : Pixels(features)) {
    right = std::max(right, p.x);
    bottom = std::max(bottom, p.y);
  }
  EXPECT_GT(right, 180.0f);
  EXPECT_LT(right, 240.0f);
  EXPECT_GT(bottom, 140.0f);
  EXPECT_LT(bottom, 192.0f);
}

TEST_P(QuotaMember, DarkImagesFillTheQuota) {
  cv::Mat dark;
  testing::TexturedImage(1, 640, 480).convertTo(dark, CV_8U, 0.1);
  const FeatureExtractor extractor(GetParam(), ExtractionOptions());
  EXPECT_GE(extractor.Extract(dark).keypoints.size(), 380u);
}

TEST_P(QuotaMember, AnImageWithoutTextureStaysWithoutFeatures) {
  const FeatureExtractor extractor(GetParam(), ExtractionOptions());
  cv::Mat ramp(192, 240, CV_8UC1);
  for (int r = 0; r < ramp.rows; ++r) {
    const int grey = 40 + r / 2;
    ramp.row(r).setTo(grey);
  }
  EXPECT_LT(extractor.Extract(ramp).keypoints.size(), 40u);
  cv::Mat noise(192, 240, CV_8UC1, cv::Scalar(80));
  cv::RNG random(1);
  for (int i = 0; i < 2000; ++i) {
    const int column = random.uniform(0, 240), row = random.uniform(0, 192);
    noise.at<std::uint8_t>(row, column) = 81;
  }
  EXPECT_LT(extractor.Extract(noise).keypoints.size(), 40u);
}

TEST(Features, SurfDescriptorsHaveUnitLengthAndFitBytes) {
  const Features features = FeatureExtractor("surf", ExtractionOptions()).Extract(testing::TexturedImage(1));
  ASSERT_FALSE(features.keypoints.empty());
  EXPECT_EQ(features.descriptors.cols, 64);
  for (int i = 0; i < features.descriptors.rows; ++i)
    EXPECT_NEAR(cv::norm(features.descriptors.row(i)), 1.0, 0.02);
  const auto fits = [](float v) { return internal::SignedSquare(internal::SignedRoot(v)) == v; };
  EXPECT_TRUE(std::all_of(features.descriptors.begin<float>(), features.descriptors.end<float>(), fits));
}

TEST(Features, UnknownMemberNamesTheNearest) {
  try {
    const FeatureExtractor extractor("surg", ExtractionOptions());
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("did you mean 'surf'"), std::string::npos) << error.what();
  }
}

TEST(ToGrey8, TakesAnyKindOfImage) {
  const cv::Mat grey = testing::TexturedImage(1);
  cv::Mat colour;
  cv::cvtColor(grey, colour, cv::COLOR_GRAY2BGR);
  EXPECT_EQ(cv::norm(ToGrey8(colour), grey, cv::NORM_INF), 0.0);
  cv::Mat deep;
  grey.convertTo(deep, CV_16U, 200.0, 1000.0);
  EXPECT_EQ(ToGrey8(deep).type(), CV_8UC1);
  double low = 0;
  double high = 0;
  cv::minMaxLoc(ToGrey8(deep), &low, &high);
  EXPECT_EQ(low, 0.0);
  EXPECT_EQ(high, 255.0);
  cv::Mat real = cv::Mat::ones(20, 20, CV_32F);
  real.at<float>(0, 0) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(ToGrey8(real).type(), CV_8UC1);
  EXPECT_EQ(ToGrey8(cv::Mat(20, 20, CV_8UC2, cv::Scalar(1, 2))).type(), CV_8UC1);
  EXPECT_TRUE(ToGrey8(cv::Mat()).empty());
}

TEST(SelectSpread, GivesEveryCellItsShareBeforeTheStrongestTakeTheRest) {
  std::vector<cv::KeyPoint> keypoints;
  keypoints.reserve(101);
  for (int i = 0; i < 100; ++i)
    keypoints.emplace_back(static_cast<float>(i % 10), 1.0f, 5.0f, 0.0f, 100.0f - i);
  keypoints.emplace_back(95.0f, 95.0f, 5.0f, 0.0f, 0.001f);  // weak and alone
  const std::vector<int> chosen = SelectSpread(keypoints, cv::Size(100, 100), 32, 4);
  EXPECT_EQ(chosen.size(), 32u);
  EXPECT_EQ(chosen.front(), 0);
  EXPECT_EQ(chosen.back(), 100);
  EXPECT_EQ(SelectSpread(keypoints, cv::Size(100, 100), 200, 4).size(), 101u);
  EXPECT_TRUE(SelectSpread({}, cv::Size(100, 100), 10, 4).empty());
}

// A cell's best, up to an equal share of all; of what is left the strongest, wherever they are.
std::set<int> SpreadByHand(const std::vector<cv::KeyPoint>& keypoints, int cell, int share, int count) {
  std::vector<int> order(keypoints.size());
  std::iota(order.begin(), order.end(), 0);
  const auto response = [&](int i) { return keypoints[static_cast<std::size_t>(i)].response; };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return response(a) > response(b); });
  std::map<std::pair<int, int>, int> taken;
  std::set<int> chosen;
  for (const bool of_cells : {true, false}) {
    for (const int i : order) {
      const cv::Point2f& p = keypoints[static_cast<std::size_t>(i)].pt;
      int& used = taken[{static_cast<int>(p.x) / cell, static_cast<int>(p.y) / cell}];
      if (static_cast<int>(chosen.size()) == count || (of_cells && used == share)) continue;
      used += chosen.insert(i).second ? 1 : 0;
    }
  }
  return chosen;
}

// Images that lie and that stand: cells are along the longer side, and the last ones are cut off.
TEST(SelectSpread, IsThatOfTheCellsByHand) {
  for (const cv::Size& size : {cv::Size(200, 90), cv::Size(90, 200)}) {
    cv::RNG random(5);
    std::vector<cv::KeyPoint> keypoints;
    for (int i = 0; i < 400; ++i) {
      const float across = random.uniform(0.0f, 1.0f), down = random.uniform(0.0f, 1.0f);
      keypoints.emplace_back(across * across * static_cast<float>(size.width),
                             down * down * static_cast<float>(size.height), 5.0f, 0.0f,
                             random.uniform(0.0f, 1.0f));
    }
    // Five cells of 40 px along the longer side, three along the other.
    for (const int count : {10, 15, 60, 150, 399}) {
      const std::vector<int> ours = SelectSpread(keypoints, size, count, 5);
      EXPECT_EQ(std::set<int>(ours.begin(), ours.end()),
                SpreadByHand(keypoints, 40, std::max(1, count / 15), count));
      EXPECT_TRUE(std::is_sorted(ours.begin(), ours.end(), [&](int a, int b) {
        return keypoints[static_cast<std::size_t>(a)].response >
               keypoints[static_cast<std::size_t>(b)].response;
      }));
    }
  }
}

}  // namespace
}  // namespace tutti
