// Depth from a stereo pair, as ExtractFeatures gives it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "data/synthetic/synthetic_world.h"
#include "frontend/dataset/rectified_rig.h"
#include "frontend/features/features.h"

namespace tutti {
namespace {

CameraRig StereoRig(int width, int height) {
  CameraRig rig;
  rig.sensor = Sensor::kStereo;
  rig.camera = Pinhole(0.6 * width, 0.6 * width, 0.5 * (width - 1), 0.5 * (height - 1), {width, height});
  rig.baseline_m = 0.5;
  return rig;
}

FrameFeatures Extract(const CameraRig& rig, const cv::Mat& left, const cv::Mat& right) {
  InputFrame frame;
  frame.image = left;
  frame.right = right;
  return ExtractFeatures(frame, rig, OdometryOptions());
}

// A sum of waves in all directions, exact between the pixels too (interpolation would bias what is measured).
class Waves {
 public:
  Waves() {
    cv::RNG rng(7);
    for (int i = 0; i < 60; ++i) {
      const double length = rng.uniform(5.0, 40.0), direction = rng.uniform(0.0, 2 * M_PI);
      waves_.push_back({2 * M_PI / length * std::cos(direction), 2 * M_PI / length * std::sin(direction),
                        rng.uniform(0.0, 2 * M_PI)});
    }
  }
  double At(double x, double y) const {
    double sum = 0;
    for (const auto& [kx, ky, phase] : waves_) sum += std::sin(kx * x + ky * y + phase);
    return std::clamp(128 + 18 * sum, 0.0, 255.0);
  }

 private:
  std::vector<std::array<double, 3>> waves_;
};

// The right view of a surface whose disparity is d0 + dx x + dy y at the pixel (x, y) of the left view.
cv::Mat RightView(int width, int height, double d0, double dx, double dy, double row = 0) {
  const Waves waves;
  cv::Mat image(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      image.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>(std::lround(waves.At((x + d0 + dy * (y - row)) / (1 - dx), y - row)));
  }
  return image;
}

cv::Mat LeftView(int width, int height) { return RightView(width, height, 0, 0, 0); }

double Median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
  return v[v.size() / 2];
}

// Standard deviation without the outermost 2 % on either side.
double Spread(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  const std::size_t cut = v.size() / 50;
  double sum = 0, squares = 0;
  for (std::size_t i = cut; i < v.size() - cut; ++i) {
    sum += v[i];
    squares += v[i] * v[i];
  }
  const double n = static_cast<double>(v.size() - 2 * cut);
  return std::sqrt(squares / n - sum * sum / n / n);
}

std::vector<double> DisparityErrors(const FrameFeatures& features, const CameraRig& rig, double d0, double dx,
                                    double dy) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < features.size(); ++i) {
    if (features.inverse_depth[i] <= 0) continue;
    const cv::Point2f& p = features.keypoints[i].pt;
    errors.push_back(double(features.inverse_depth[i]) * rig.camera.fx * rig.baseline_m -
                     (d0 + dx * p.x + dy * p.y));
  }
  return errors;
}

TEST(StereoMatcher, FlatSurfaceHasItsSubPixelDisparity) {
  const CameraRig rig = StereoRig(480, 240);
  const cv::Mat left = LeftView(480, 240);
  for (const double disparity : {3.0, 7.3, 20.5}) {
    const auto errors =
        DisparityErrors(Extract(rig, left, RightView(480, 240, disparity, 0, 0)), rig, disparity, 0, 0);
    ASSERT_GT(errors.size(), 300U) << disparity;
    EXPECT_NEAR(Median(errors), 0, 0.01) << disparity;
    EXPECT_LT(Spread(errors), 0.1) << disparity;
  }
}

TEST(StereoMatcher, SlantedSurfaceHasTheDisparityOfTheKeypointItself) {
  const CameraRig rig = StereoRig(480, 240);
  const cv::Mat left = LeftView(480, 240);
  // The ground under a car (shear), walls on both sides of the way (stretch).
  for (const auto& [dx, dy] : {std::pair{0.0, 0.25}, {0.08, 0.0}, {-0.08, 0.0}}) {
    const double d0 = dx < 0 ? 45 : 5;
    const auto errors = DisparityErrors(Extract(rig, left, RightView(480, 240, d0, dx, dy)), rig, d0, dx, dy);
    ASSERT_GT(errors.size(), 150U) << dx << " " << dy;
    EXPECT_NEAR(Median(errors), 0, 0.02) << dx << " " << dy;
    EXPECT_LT(Spread(errors), 0.2) << dx << " " << dy;
  }
}

// Whether a plane describes the inverse depth around a pixel to within a 50th of a pixel of disparity.
bool IsPlane(const cv::Mat& depth, int x, int y, int h, double fb) {
  if (x < h || y < h || x + h >= depth.cols || y + h >= depth.rows) return false;
  const auto at = [&](int dx, int dy) { return fb / double(depth.at<float>(y + dy, x + dx)); };
  const double gx = (at(h, 0) - at(-h, 0)) / (2 * h), gy = (at(0, h) - at(0, -h)) / (2 * h);
  for (const int dy : {-h, -h / 2, 0, h / 2, h}) {
    for (const int dx : {-h, -h / 2, 0, h / 2, h}) {
      if (!(std::abs(at(dx, dy) - at(0, 0) - gx * dx - gy * dy) < 0.02)) return false;
    }
  }
  return true;
}

// A bias of 0.05 px scales the trajectory through this town by 0.4 %.
TEST(StereoMatcher, DisparityIsUnbiasedOnEveryPyramidLevelOfTheTown) {
  SyntheticOptions options;
  options.sensor = SyntheticSensor::kStereo;
  const SyntheticWorld world(options);
  CameraRig rig;
  rig.sensor = Sensor::kStereo;
  rig.camera = world.Camera();
  rig.baseline_m = world.Options().baseline_m;
  const double fb = rig.camera.fx * rig.baseline_m;
  std::vector<double> all, near, far;
  std::vector<std::vector<double>> by_octave(8);
  for (std::size_t i = 0; i < 12; ++i) {
    const SyntheticFrame frame = world.Render(i * 17);
    const cv::Mat depth = world.ExactDepth(i * 17);
    const FrameFeatures features = Extract(rig, frame.image, frame.right);
    EXPECT_LT(features.row_error_px, 0.1) << i;
    EXPECT_GT(features.stereo_matches, 500) << i;
    for (std::size_t f = 0; f < features.size(); ++f) {
      if (features.inverse_depth[f] <= 0) continue;
      const cv::KeyPoint& k = features.keypoints[f];
      const int x = static_cast<int>(k.pt.x), y = static_cast<int>(k.pt.y);
      if (!IsPlane(depth, x, y, static_cast<int>(std::ceil(7 * std::pow(1.2, k.octave))), fb)) continue;
      // 1/z is linear in the pixel.
      const double z = depth.at<float>(y, x), right = depth.at<float>(y, x + 1),
                   below = depth.at<float>(y + 1, x);
      const double exact = 1 / z + (k.pt.x - x) * (1 / right - 1 / z) + (k.pt.y - y) * (1 / below - 1 / z);
      const double error = (double(features.inverse_depth[f]) - exact) * fb;
      all.push_back(error);
      (z < 12 ? near : far).push_back(error);
      by_octave[static_cast<std::size_t>(k.octave)].push_back(error);
    }
  }
  ASSERT_GT(all.size(), 3000U);
  EXPECT_NEAR(Median(all), 0, 0.01);
  EXPECT_NEAR(Median(near), 0, 0.015);
  EXPECT_NEAR(Median(far), 0, 0.015);
  EXPECT_LT(Spread(all), 0.2);
  for (std::size_t octave = 0; octave < by_octave.size(); ++octave) {
    const double scale = std::pow(1.2, octave);
    ASSERT_GT(by_octave[octave].size(), 60U) << octave;
    EXPECT_NEAR(Median(by_octave[octave]), 0, 0.015 * scale) << octave;
    EXPECT_LT(Spread(by_octave[octave]), 0.15 * scale) << octave;
  }
}

TEST(StereoMatcher, RowErrorTellsOfABadRectification) {
  const CameraRig rig = StereoRig(480, 240);
  const cv::Mat left = LeftView(480, 240);
  EXPECT_LT(Extract(rig, left, RightView(480, 240, 7.3, 0, 0)).row_error_px, 0.05);
  EXPECT_NEAR(Extract(rig, left, RightView(480, 240, 7.3, 0, 0, 0.7)).row_error_px, 0.7, 0.1);
}

TEST(StereoMatcher, BrightnessOfTheCamerasMayDiffer) {
  const CameraRig rig = StereoRig(480, 240);
  const cv::Mat left = LeftView(480, 240) * 0.8;
  const cv::Mat right = RightView(480, 240, 7.3, 0, 0) * 0.8 + cv::Scalar(25);
  const auto errors = DisparityErrors(Extract(rig, left, right), rig, 7.3, 0, 0);
  ASSERT_GT(errors.size(), 300U);
  EXPECT_NEAR(Median(errors), 0, 0.01);
}

TEST(StereoMatcher, ViewsOfDifferentPlacesHaveHardlyAMatch) {
  const CameraRig rig = StereoRig(480, 240);
  const cv::Mat left = LeftView(480, 240);
  cv::Mat other;
  cv::rotate(left, other, cv::ROTATE_180);
  const FrameFeatures features = Extract(rig, left, other);
  ASSERT_GT(features.size(), 400U);
  EXPECT_LT(features.stereo_matches, static_cast<int>(features.size() / 20));
}

TEST(StereoMatcher, BlankOrTinyRightImageGivesFeaturesWithoutDepth) {
  const CameraRig rig = StereoRig(480, 240);
  const cv::Mat left = LeftView(480, 240);
  for (const int grey : {0, 128, 255}) {
    const FrameFeatures features = Extract(rig, left, cv::Mat(left.size(), CV_8UC1, cv::Scalar(grey)));
    EXPECT_GT(features.size(), 400U);
    EXPECT_EQ(features.stereo_matches, 0);
    EXPECT_EQ(std::count(features.inverse_depth.begin(), features.inverse_depth.end(), 0.0F),
              static_cast<std::ptrdiff_t>(features.size()));
  }
  for (const int side : {1, 20, 39, 50}) {
    const cv::Mat small = LeftView(side, side);
    EXPECT_LT(Extract(StereoRig(side, side), small, small).size(), 100U) << side;
  }
}

}  // namespace
}  // namespace tutti
