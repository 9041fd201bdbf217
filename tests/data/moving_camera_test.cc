#include "data/synthetic/moving_camera.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace tutti::synthetic {
namespace {

TEST(HandTest, TurnsAboutEachAxisAsFastAsToldAndIsCalmBetweenBursts) {
  const double peak = 200;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Hand hand(seed, peak);
    Eigen::Vector3d fastest = Eigen::Vector3d::Zero();
    int calm = 0, moments = 0;
    constexpr double kStep = 0.005;
    for (double t = 0; t < 20; t += kStep, ++moments) {
      const Pose step = hand.At(t).Inverse() * hand.At(t + kStep);
      const Eigen::Vector3d speed = LogSE3(step).tail<3>() * (180 / M_PI / kStep);
      fastest = fastest.cwiseMax(speed.cwiseAbs());
      calm += speed.norm() < 0.1 * peak ? 1 : 0;
      EXPECT_LT(step.translation.norm(), 2 * 0.21 * step.Angle() + 1e-9);  // on its lever
    }
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_GT(fastest(axis), 0.5 * peak) << "axis " << axis << " seed " << seed;
      EXPECT_LT(fastest(axis), 1.6 * peak) << "axis " << axis << " seed " << seed;
    }
    EXPECT_GT(calm, 0.1 * moments) << seed;
    EXPECT_LT(calm, 0.6 * moments) << seed;
  }
}

TEST(HandTest, StartsAtRestAndASteadyHandStays) {
  EXPECT_LT(LogSE3(Hand(1, 200).At(0.02)).norm(), 1e-3);
  EXPECT_EQ(LogSE3(Hand(1, 0).At(2)).norm(), 0);
}

PinholeCamera Camera() {
  PinholeCamera camera;
  camera.width = 160;
  camera.height = 121;
  camera.fx = camera.fy = 150;
  camera.cx = 79.5;
  camera.cy = 60;
  return camera;
}

// A wall 2 m ahead, black to the left of x = 0 and white to the right, seen by a camera that turns to the
// right.
constexpr double kTurning = 0.5;  // [rad/s]

Rendering EdgeSeenTurning(const PinholeCamera& rows, double time_s) {
  static const std::vector<Texture> textures = [] {
    std::vector<Texture> both;
    for (const int grey : {0, 255}) both.emplace_back(cv::Mat(4, 4, CV_8UC1, cv::Scalar(grey)));
    return both;
  }();
  std::vector<Face> faces;
  for (const int side : {0, 1})
    faces.push_back(Quad({side == 0 ? -20.0 : 0.0, -20, 2}, {20, 0, 0}, {0, 40, 0}, side));
  for (Face& face : faces) face.emits = true;
  const Pose turned(ExpSO3(Eigen::Vector3d(0, kTurning * time_s, 0)), Eigen::Vector3d::Zero());
  Light light;
  light.gain = 1;
  return Render(faces, textures, rows, turned, light, 4);
}

// Where the edge stands in a row: the number of dark pixels.
double EdgeIn(const cv::Mat& image, int row) {
  double dark = 0;
  for (int x = 0; x < image.cols; ++x) dark += 1 - image.at<float>(row, x) / 255;
  return dark;
}

TEST(ShutterTest, AReadoutShearsAVerticalEdgeByTheTurningOfItsTime) {
  const PinholeCamera camera = Camera();
  const Rendering still = Expose(camera, {}, 0, EdgeSeenTurning);
  EXPECT_NEAR(EdgeIn(still.image, 0), EdgeIn(still.image, camera.height - 1), 1e-3);
  Shutter shutter;
  shutter.readout_s = 0.04;
  const Rendering rolling = Expose(camera, shutter, 0, EdgeSeenTurning);
  // Strips of four rows have one time: what they miss is less than two rows' worth.
  const double shear = EdgeIn(rolling.image, 0) - EdgeIn(rolling.image, camera.height - 1);
  EXPECT_NEAR(shear, kTurning * shutter.readout_s * camera.fx, 0.15);
  EXPECT_NEAR(EdgeIn(rolling.image, 60), EdgeIn(still.image, 60), 0.1);
  EXPECT_EQ(rolling.depth_m.size(), still.depth_m.size());
}

TEST(ShutterTest, AnExposureSpreadsAnEdgeOverTheTurningOfItsTime) {
  Shutter shutter;
  shutter.exposure_s = 0.08;
  shutter.samples = 21;
  const Rendering blurred = Expose(Camera(), shutter, 0, EdgeSeenTurning);
  int grey = 0;
  for (int x = 0; x < blurred.image.cols; ++x) {
    const float value = blurred.image.at<float>(60, x);
    grey += value > 2 && value < 253 ? 1 : 0;
  }
  EXPECT_NEAR(grey, kTurning * shutter.exposure_s * Camera().fx, 1.5);
}

TEST(ShutterTest, AStripIsThatPartOfTheWholeImage) {
  const PinholeCamera camera = Camera();
  const Rendering whole = EdgeSeenTurning(camera, 0.1), part = EdgeSeenTurning(RowsOf(camera, 40, 4), 0.1);
  EXPECT_LT(cv::norm(whole.image.rowRange(40, 44), part.image, cv::NORM_INF), 1e-3);
  EXPECT_LT(cv::norm(whole.depth_m.rowRange(40, 44), part.depth_m, cv::NORM_INF), 1e-5);
}

}  // namespace
}  // namespace tutti::synthetic
