#include "loopclosure/features/orb.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <tuple>
#include <utility>

#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/test_data.h"
#include "tutti/loopclosure/features.h"

namespace tutti::internal {
namespace {

struct Detected {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;
};

Detected ByOpenCv(const cv::Mat& image, const OrbOptions& options) {
  Detected found;
  cv::ORB::create(options.features, 1.2F, options.levels, options.edge, 0, 2, cv::ORB::HARRIS_SCORE, 31,
                  options.fast_threshold)
      ->detectAndCompute(image, cv::noArray(), found.keypoints, found.descriptors);
  return found;
}

auto All(const cv::KeyPoint& k) {
  return std::make_tuple(k.pt.x, k.pt.y, k.size, k.angle, k.response, k.octave, k.class_id);
}

void ExpectSame(const Detected& ours, const Detected& expected, const std::string& what) {
  ASSERT_EQ(ours.keypoints.size(), expected.keypoints.size()) << what;
  for (std::size_t i = 0; i < ours.keypoints.size(); ++i) {
    ASSERT_EQ(All(ours.keypoints[i]), All(expected.keypoints[i])) << what << ", point " << i;
  }
  ASSERT_EQ(ours.descriptors.size(), expected.descriptors.size()) << what;
  if (!ours.descriptors.empty()) {
    ASSERT_EQ(cv::norm(ours.descriptors, expected.descriptors, cv::NORM_HAMMING), 0) << what;
  }
}

// Number of points; both ways have to give the same ones in the same order.
std::size_t Compare(const cv::Mat& image, const OrbOptions& options, const std::string& what = {}) {
  const Orb orb(image, options);
  Detected ours;
  ours.keypoints = orb.Detect();
  ours.descriptors = orb.Describe(ours.keypoints);
  const Detected expected = ByOpenCv(image, options);
  ExpectSame(ours, expected,
             what + " " + std::to_string(image.cols) + "x" + std::to_string(image.rows) + ", " +
                 std::to_string(options.features) + " features");
  return expected.keypoints.size();
}

cv::Mat Noise(int seed, const cv::Size& size, double blur) {
  cv::RNG random(static_cast<std::uint64_t>(seed));
  cv::Mat noise(size, CV_8UC1);
  random.fill(noise, cv::RNG::UNIFORM, 0, 256);
  if (blur > 0) cv::GaussianBlur(noise, noise, cv::Size(5, 5), blur);
  return noise;
}

// The member asks for twice its quota of points.
OrbOptions Default(const cv::Mat& image) { return OrbOptionsFor(image.size(), 800); }

TEST(Orb, PointsAndDescriptorsAreThoseOfOpenCv) {
  for (const int seed : {1, 2, 3}) {
    const cv::Mat texture = testing::TexturedImage(static_cast<std::uint32_t>(seed), 641, 479);
    EXPECT_GE(Compare(texture, Default(texture)), 700U);
    for (const double blur : {0.0, 1.2}) {
      const cv::Mat noise = Noise(seed, {333, 240}, blur);
      EXPECT_GE(Compare(noise, Default(noise)), 700U);
    }
  }
}

TEST(Orb, QuotasCutTheListWhereOpenCvDoes) {
  const cv::Mat texture = testing::TexturedImage(4, 480, 360);
  OrbOptions options = Default(texture);
  for (const int features : {0, 1, 2, 7, 50, 333, 1200, 20000}) {
    options.features = features;
    Compare(texture, options);
  }
}

TEST(Orb, AnyLevelsBordersAndThresholdsGiveTheSame) {
  const cv::Mat texture = testing::TexturedImage(5, 320, 240);
  for (const int levels : {1, 2, 5, 8}) {
    for (const int edge : {3, 4, 5, 12, 31}) {
      for (const int threshold : {1, 10, 60, 255}) Compare(texture, {500, levels, edge, threshold});
    }
  }
}

TEST(Orb, ImagesOfAnySizeGiveTheSame) {
  cv::RNG random(6);
  std::size_t points = 0;
  for (int i = 0; i < 300; ++i) {
    const cv::Size size(random.uniform(16, 150), random.uniform(16, 100));
    const cv::Mat image = Noise(i, size, i % 2 == 0 ? 0 : 1.2);
    points += Compare(image, Default(image));
  }
  EXPECT_GT(points, 10000U);
}

TEST(Orb, PartsOfAnImageGiveTheSame) {
  const cv::Mat texture = testing::TexturedImage(7, 640, 480);
  for (const cv::Rect& part :
       {cv::Rect(0, 0, 300, 200), cv::Rect(5, 30, 301, 203), cv::Rect(340, 280, 300, 200)}) {
    EXPECT_GT(Compare(texture(part), Default(texture(part))), 100U);
  }
}

// All have the same score and the same response: none may be left out for being the last of its kind.
TEST(Orb, CornersThatAreAllEqualStayTogether) {
  cv::Mat image(400, 600, CV_8UC1, cv::Scalar(40));
  for (int y = 30; y + 30 < image.rows; y += 12) {
    for (int x = 30; x + 30 < image.cols; x += 12) image.at<std::uint8_t>(y, x) = 200;
  }
  OrbOptions options{100, 1, 20, 10};
  EXPECT_GT(Compare(image, options), 1000U);
  options.levels = 8;
  EXPECT_GT(Compare(image, options), 1000U);
}

TEST(Orb, NothingInImagesThatAreBlankOrSmall) {
  for (const cv::Size& size : {cv::Size(16, 16), cv::Size(640, 480), cv::Size(3000, 20)}) {
    for (const int grey : {0, 128, 255}) {
      const cv::Mat image(size, CV_8UC1, cv::Scalar(grey));
      EXPECT_EQ(Compare(image, Default(image)), 0U);
    }
  }
  EXPECT_EQ(Compare(Noise(8, {62, 62}, 0), {100, 1, 31, 10}), 0U);
}

TEST(Orb, SomePointsInAnyOrderGetTheDescriptorsThatTheyHaveAmongAll) {
  const cv::Mat texture = testing::TexturedImage(9, 480, 360);
  const Orb orb(texture, Default(texture));
  const Detected all = ByOpenCv(texture, Default(texture));
  Detected ours, expected;
  const std::vector<cv::KeyPoint> detected = orb.Detect();
  for (std::size_t i = 0; i < detected.size(); i += 3) {
    const std::size_t at = detected.size() - 1 - i;
    ours.keypoints.push_back(detected[at]);
    expected.keypoints.push_back(all.keypoints[at]);
    expected.descriptors.push_back(all.descriptors.row(static_cast<int>(at)));
  }
  ours.descriptors = orb.Describe(ours.keypoints);
  ExpectSame(ours, expected, "every third");
}

// What the member makes of all that OpenCV detects and describes.
Features SpreadByOpenCv(const cv::Mat& image, const ExtractionOptions& options) {
  const Detected all = ByOpenCv(image, OrbOptionsFor(image.size(), 2 * options.features));
  Features kept;
  for (const int i : SelectSpread(all.keypoints, image.size(), options.features)) {
    kept.keypoints.push_back(all.keypoints[static_cast<std::size_t>(i)]);
    kept.descriptors.push_back(all.descriptors.row(i));
  }
  return kept;
}

TEST(Orb, TheMemberKeepsTheSameWithAMaskAndWithout) {
  const cv::Mat texture = testing::TexturedImage(10, 640, 480);
  cv::Mat mask(texture.size(), CV_8UC1, cv::Scalar(255));
  mask(cv::Rect(100, 0, 300, 350)).setTo(0);
  for (const int features : {20, 400, 5000}) {
    ExtractionOptions options;
    options.features = features;
    Features ours = FeatureExtractor("orb", options).Extract(texture);
    Features expected = SpreadByOpenCv(texture, options);
    for (const cv::Mat& seen : {cv::Mat(), mask}) {
      DropMasked(seen, ours);
      DropMasked(seen, expected);
      EXPECT_FALSE(ours.keypoints.empty());
      ExpectSame({ours.keypoints, ours.descriptors}, {expected.keypoints, expected.descriptors}, "member");
    }
  }
}

// Some images of a folder, evenly spread.
void CompareImages(const std::filesystem::path& folder, std::size_t images) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string kind = entry.path().extension();
    if (kind == ".jpg" || kind == ".png" || kind == ".webp") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  ASSERT_GE(files.size(), images);
  std::size_t points = 0;  // of all: a few images show a bare wall
  for (std::size_t i = 0; i < images; ++i) {
    const std::filesystem::path& file = files[i * files.size() / images];
    const cv::Mat image = cv::imread(file, cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(image.empty()) << file;
    points += Compare(image, Default(image), file.string());
  }
  EXPECT_GT(points, 100 * images);
}

class OrbOnData : public ::testing::TestWithParam<std::pair<const char*, const char*>> {};
INSTANTIATE_TEST_SUITE_P(Folders, OrbOnData,
                         ::testing::Values(std::pair("kitti_00_head", "image_0"),
                                           std::pair("redkitchen", "rgb"), std::pair("corridor", "")));

TEST_P(OrbOnData, PointsAndDescriptorsAreThoseOfOpenCv) {
  TUTTI_REQUIRE_DATA(folder, GetParam().first);
  CompareImages(folder / GetParam().second, 25);
}

}  // namespace
}  // namespace tutti::internal
