#include "frontend/features/features.h"
#include "tests/support/rendered_world.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace tutti {
namespace {

cv::Mat StreetImage() {
  SyntheticOptions options;
  options.width = 480;
  options.height = 240;
  return testing::RenderedWorld(options).Render(3).image;
}

FrameFeatures Detect(const cv::Mat& image, const OdometryOptions& options = {}) {
  return ExtractOrb(BuildPyramid(image, options), options);
}

// A dark square on light ground; its corners lie between pixels, at 79.5 and 159.5.
cv::Mat Square() {
  cv::Mat image(240, 240, CV_8UC1, cv::Scalar(200));
  image(cv::Rect(80, 80, 80, 80)).setTo(40);
  return image;
}

TEST(HammingDistance, CountsDifferingBits) {
  std::array<std::uint8_t, 32> a{}, b{};
  EXPECT_EQ(HammingDistance(a.data(), b.data()), 0);
  b.fill(0xFF);
  EXPECT_EQ(HammingDistance(a.data(), b.data()), 256);
  b.fill(0);
  b[0] = 0x80;
  b[13] = 0x11;
  b[31] = 0x01;
  EXPECT_EQ(HammingDistance(a.data(), b.data()), 4);
}

TEST(FrameFeatures, ScalesAreAGeometricSeries) {
  const std::vector<float> scales = PyramidScales(OdometryOptions());
  ASSERT_EQ(scales.size(), 8U);
  EXPECT_FLOAT_EQ(scales[0], 1.0F);
  EXPECT_FLOAT_EQ(scales[7], std::pow(1.2F, 7.0F));
}

TEST(FrameFeatures, NoneLiesUnderTheMaskOnAnyLevel) {
  const cv::Mat image = StreetImage();
  cv::Mat mask(image.size(), CV_8UC1, cv::Scalar(255));
  for (int y = 0; y < mask.rows; ++y) {
    for (int x = 0; x < mask.cols; ++x) mask.at<std::uint8_t>(y, x) = (x / 23 + y / 17) % 2 == 0 ? 0 : 9;
  }
  const OdometryOptions options;
  const FrameFeatures masked = ExtractOrb(BuildPyramid(image, options), options, mask);
  EXPECT_GT(masked.size(), Detect(image).size() / 3);
  ASSERT_EQ(masked.descriptors.rows, static_cast<int>(masked.size()));
  int highest = 0;
  for (const cv::KeyPoint& k : masked.keypoints) {
    highest = std::max(highest, k.octave);
    EXPECT_NE(mask.at<std::uint8_t>(int(std::lround(k.pt.y)), int(std::lround(k.pt.x))), 0)
        << k.pt << " on " << k.octave;
  }
  EXPECT_GE(highest, 3);
}

TEST(FrameFeatures, BlankImagesHaveNone) {
  for (const int grey : {0, 128, 255}) {
    const FrameFeatures features = Detect(cv::Mat(240, 320, CV_8UC1, cv::Scalar(grey)));
    EXPECT_EQ(features.size(), 0U);
    std::vector<int> found{1};
    features.InArea({100, 100}, 1000, 0, 7, &found);
    EXPECT_TRUE(found.empty());
  }
}

TEST(FrameFeatures, ImagesTooSmallForADescriptorHaveNone) {
  cv::RNG rng(3);
  for (const cv::Size size :
       {cv::Size(1, 1), cv::Size(5, 200), cv::Size(200, 5), cv::Size(38, 38), cv::Size(41, 39)}) {
    cv::Mat noise(size, CV_8UC1);
    rng.fill(noise, cv::RNG::UNIFORM, 0, 256);
    const FrameFeatures features = Detect(noise);
    EXPECT_LT(features.size(), 10U) << size;
    EXPECT_EQ(features.descriptors.rows, static_cast<int>(features.size()));
  }
  EXPECT_EQ(Detect(cv::Mat()).size(), 0U);
}

TEST(FrameFeatures, NumberIsWhatWasAskedForAndEveryPartOfTheImageHasSome) {
  const cv::Mat image = StreetImage();
  OdometryOptions options;
  options.features = 800;
  const FrameFeatures features = Detect(image, options);
  EXPECT_LE(features.size(), 800U);
  EXPECT_GT(features.size(), 600U);
  ASSERT_EQ(features.descriptors.rows, static_cast<int>(features.size()));
  EXPECT_EQ(features.inverse_depth.size(), features.size());
  std::array<int, 8> parts{};
  for (const cv::KeyPoint& k : features.keypoints) {
    EXPECT_GE(k.pt.x, 10);
    EXPECT_LE(k.pt.x, image.cols - 10);
    EXPECT_GE(k.octave, 0);
    EXPECT_LT(k.octave, 8);
    // Eight columns of the image.
    ++parts[static_cast<std::size_t>(
        std::min(7, static_cast<int>(k.pt.x * 8 / static_cast<float>(image.cols))))];
  }
  for (const int count : parts) EXPECT_GT(count, 20);
}

TEST(FrameFeatures, SameImageGivesTheSameBits) {
  const cv::Mat image = StreetImage();
  const FrameFeatures a = Detect(image), b = Detect(image.clone());
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a.keypoints[i].pt, b.keypoints[i].pt);
    EXPECT_EQ(a.keypoints[i].angle, b.keypoints[i].angle);
  }
  EXPECT_EQ(cv::norm(a.descriptors, b.descriptors, cv::NORM_INF), 0);
}

TEST(FrameFeatures, ACornerHasOnePlaceOnAllPyramidLevels) {
  const FrameFeatures features = Detect(Square());
  const std::vector<float> scales = PyramidScales(OdometryOptions());
  std::array<int, 8> seen{};
  for (const cv::KeyPoint& k : features.keypoints) {
    const double x = k.pt.x < 120 ? 79.5 : 159.5, y = k.pt.y < 120 ? 79.5 : 159.5;
    const double scale = double(scales[static_cast<std::size_t>(k.octave)]);
    // FAST may stand more than a pixel from a blurred corner; then it is not refined.
    const double bound = k.octave == 0 ? 0.3 : 1.6 * scale;
    EXPECT_NEAR(k.pt.x, x, bound) << "octave " << k.octave;
    EXPECT_NEAR(k.pt.y, y, bound) << "octave " << k.octave;
    ++seen[static_cast<std::size_t>(k.octave)];
  }
  EXPECT_GE(std::count_if(seen.begin(), seen.end(), [](int count) { return count >= 4; }), 5);
}

// The mean over the four corners of the square is its centre, whatever a corner detector does at a corner.
TEST(FrameFeatures, PyramidLevelsHaveNoOffset) {
  const FrameFeatures features = Detect(Square());
  for (int octave = 0; octave < 8; ++octave) {
    cv::Point2d sum(0, 0);
    int n = 0;
    for (const cv::KeyPoint& k : features.keypoints) {
      if (k.octave != octave) continue;
      sum += cv::Point2d(k.pt);
      ++n;
    }
    if (n != 4) continue;
    EXPECT_NEAR(sum.x / n, 119.5, 0.15 * std::pow(1.2, octave)) << octave;
    EXPECT_NEAR(sum.y / n, 119.5, 0.15 * std::pow(1.2, octave)) << octave;
  }
}

TEST(FrameFeatures, AreaSearchFindsWhatLooksAtEveryFeatureFind) {
  const FrameFeatures features = Detect(StreetImage());
  cv::RNG rng(5);
  std::vector<int> found;
  for (int trial = 0; trial < 200; ++trial) {
    const float y = rng.uniform(-50.0F, 290.0F), x = rng.uniform(-50.0F, 530.0F);
    const cv::Point2f centre(x, y);
    const float radius = rng.uniform(0.5F, 90.0F);
    const int first = rng.uniform(0, 8), last = rng.uniform(first, 8);
    features.InArea(centre, radius, first, last, &found);
    std::vector<int> expected;
    for (std::size_t i = 0; i < features.size(); ++i) {
      const cv::KeyPoint& k = features.keypoints[i];
      if (k.octave >= first && k.octave <= last && std::abs(k.pt.x - centre.x) <= radius &&
          std::abs(k.pt.y - centre.y) <= radius)
        expected.push_back(static_cast<int>(i));
    }
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, expected);
  }
}

class DepthImageTest : public ::testing::Test {
 protected:
  FrameFeatures WithDepth(const cv::Mat& depth) const {
    InputFrame frame;
    frame.image = Square();
    frame.depth_m = depth;
    return ExtractFeatures(frame, rig_, OdometryOptions());
  }
  static std::ptrdiff_t Known(const FrameFeatures& f) {
    return std::count_if(f.inverse_depth.begin(), f.inverse_depth.end(), [](float d) { return d != 0; });
  }
  CameraRig rig_;
};

TEST_F(DepthImageTest, FlatDepthIsTakenOverWithItsDeviation) {
  const FrameFeatures features = WithDepth(cv::Mat(240, 240, CV_32FC1, cv::Scalar(4.0)));
  ASSERT_GT(features.size(), 4U);
  for (std::size_t i = 0; i < features.size(); ++i) {
    EXPECT_FLOAT_EQ(features.inverse_depth[i], 0.25F);
    EXPECT_FLOAT_EQ(features.inverse_depth_sigma[i], 0.004F);
  }
}

TEST_F(DepthImageTest, NonsenseIsNoDepth) {
  for (const float z : {0.0F, -3.0F, 0.01F, std::numeric_limits<float>::quiet_NaN(),
                        std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()}) {
    const FrameFeatures features = WithDepth(cv::Mat(240, 240, CV_32FC1, cv::Scalar(double(z))));
    EXPECT_EQ(Known(features), 0) << z;
    for (const float d : features.inverse_depth) EXPECT_TRUE(std::isfinite(d)) << z;
  }
}

TEST_F(DepthImageTest, FartherThanTheLimitIsNoDepth) {
  rig_.max_depth_m = 3.5;
  EXPECT_EQ(Known(WithDepth(cv::Mat(240, 240, CV_32FC1, cv::Scalar(4.0)))), 0);
  rig_.max_depth_m = 4.5;
  EXPECT_GT(Known(WithDepth(cv::Mat(240, 240, CV_32FC1, cv::Scalar(4.0)))), 4);
}

TEST_F(DepthImageTest, DepthEdgesAreNotTrusted) {
  // Every second pixel is farther away: each has a neighbour on another surface.
  cv::Mat depth(240, 240, CV_32FC1, cv::Scalar(2.0));
  for (int y = 0; y < 240; ++y) {
    for (int x = y % 2; x < 240; x += 2) depth.at<float>(y, x) = 3.0F;
  }
  EXPECT_EQ(Known(WithDepth(depth)), 0);
}

TEST_F(DepthImageTest, TheGridHasEveryEighthPixelOfASmallImage) {
  cv::Mat depth(240, 240, CV_32FC1, cv::Scalar(2.0));
  depth(cv::Rect(120, 0, 120, 240)) = 4.0;  // an edge between columns 119 and 120
  depth(cv::Rect(0, 0, 240, 16)) = 0;
  const FrameFeatures features = WithDepth(depth);
  ASSERT_TRUE(features.depth_grid);
  const DepthGrid& grid = *features.depth_grid;
  EXPECT_EQ(grid.step, 8);
  EXPECT_EQ(grid.columns, 30);
  EXPECT_EQ(grid.Rows(), 30);
  EXPECT_EQ(grid.PixelOf(2, 1), Eigen::Vector2d(12, 20));
  EXPECT_FLOAT_EQ(grid.At(10, 3), 0.5F);
  EXPECT_FLOAT_EQ(grid.At(10, 20), 0.25F);
  EXPECT_EQ(grid.At(0, 3), 0) << "nothing was measured";
  EXPECT_FLOAT_EQ(grid.Near({115, 100}), 0.5F);
  EXPECT_FLOAT_EQ(grid.Near({1e4, -5}), 0) << "of the nearest element, as far as it may be";
  EXPECT_FALSE(WithoutImages(features)->depth_grid);
}

TEST_F(DepthImageTest, TheGridSaysWhereAnEdgeIsAndLeavesOutWhatIsMasked) {
  cv::Mat depth(240, 240, CV_32FC1, cv::Scalar(2.0));
  depth(cv::Rect(125, 0, 115, 240)) = 4.0;  // beside column 124 of the grid
  InputFrame frame;
  frame.image = Square();
  frame.depth_m = depth;
  frame.mask = cv::Mat(240, 240, CV_8UC1, cv::Scalar(255));
  frame.mask(cv::Rect(0, 0, 40, 240)) = 0;
  const FrameFeatures features = ExtractFeatures(frame, rig_, OdometryOptions());
  ASSERT_TRUE(features.depth_grid);
  EXPECT_FLOAT_EQ(features.depth_grid->At(10, 15), -0.5F);
  EXPECT_FLOAT_EQ(features.depth_grid->Near({124, 84}), 0.5F);
  EXPECT_EQ(features.depth_grid->At(10, 4), 0);
  EXPECT_FLOAT_EQ(features.depth_grid->At(10, 5), 0.5F);
}

TEST_F(DepthImageTest, TheGridOfALargeImageIsCoarser) {
  InputFrame frame;
  frame.image = cv::Mat(960, 1280, CV_8UC1, cv::Scalar(90));
  frame.depth_m = cv::Mat(960, 1280, CV_32FC1, cv::Scalar(2.0));
  const FrameFeatures features = ExtractFeatures(frame, rig_, OdometryOptions());
  ASSERT_TRUE(features.depth_grid);
  EXPECT_EQ(features.depth_grid->step, 25);
  EXPECT_NEAR(double(features.depth_grid->inverse_depth.size()), 2000, 200);
}

}  // namespace
}  // namespace tutti
