#include "frontend/map/self_calibration.h"

#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "tests/support/plain_camera.h"

namespace tutti {
namespace {

CameraRig Rig(Sensor sensor) {
  CameraRig rig;
  rig.sensor = sensor;
  rig.camera = testing::PlainCamera(450);
  return rig;
}

std::shared_ptr<const FrameFeatures> OneFeature(float x, float y) {
  auto features = std::make_shared<FrameFeatures>();
  features->keypoints.emplace_back(x, y, 31.0F);
  features->BuildGrid(640, 480);
  return features;
}

// What a window says that knows k1 to `sigma`.
LensError LensErrorSeen(const SelfCalibration& calibration, double k1, double sigma) {
  LensError seen;
  seen.value = {k1 - calibration.Applied().x(), -calibration.Applied().y()};
  seen.information = Eigen::Matrix2d::Identity() / (sigma * sigma);
  return seen;
}

class SelfCalibrationTest : public ::testing::Test {
 protected:
  SelfCalibrationTest() {
    Keyframe keyframe;
    keyframe.features = OneFeature(600, 400);
    map_.AddKeyframe(keyframe);
  }
  Map map_{{1.0F}};
};

TEST_F(SelfCalibrationTest, ComesToWhatTheWindowsSay) {
  SelfCalibration calibration(OdometryOptions(), Rig(Sensor::kMono));
  for (int i = 0; i < 200; ++i) calibration.Learn(LensErrorSeen(calibration, -0.02, 0.001), 10, &map_);
  EXPECT_NEAR(calibration.Applied().x(), -0.02, 0.001);
}

TEST_F(SelfCalibrationTest, AnErrorBeyondAllReasonMovesNoPixel) {
  SelfCalibration calibration(OdometryOptions(), Rig(Sensor::kMono));
  for (int i = 0; i < 9; ++i) calibration.Learn(LensErrorSeen(calibration, 1e9, 0.001), 10, &map_);
  ASSERT_GT(calibration.Applied().x(), 1e6);
  EXPECT_EQ(std::as_const(map_).keyframe(0).features->keypoints[0].pt, cv::Point2f(600, 400));
  // With this error taken out of it already, which can't be undone.
  auto features = std::make_shared<FrameFeatures>(*OneFeature(500, 300));
  features->lens = {1e9, 1e9};
  EXPECT_EQ(calibration.Correct(features)->keypoints[0].pt, cv::Point2f(500, 300));
}

TEST_F(SelfCalibrationTest, SaysWhatItFoundAndHowWellItIsKnown) {
  SelfCalibration calibration(OdometryOptions(), Rig(Sensor::kMono));
  const double at_first = calibration.Found().k1_sigma;
  EXPECT_NEAR(at_first, OdometryOptions().lens_sigma, 1e-9);
  for (int i = 0; i < 50; ++i) calibration.Learn(LensErrorSeen(calibration, -0.02, 0.001), 10, &map_);
  const LensFound found = calibration.Found();
  EXPECT_NEAR(found.k1, -0.02, 0.002);
  EXPECT_LT(found.k1_sigma, 0.2 * at_first);
  ASSERT_FALSE(found.steps.empty());
  EXPECT_EQ(found.steps.back().k1, calibration.Applied().x());
  EXPECT_LT(found.steps.back().k1_sigma, at_first);
}

TEST_F(SelfCalibrationTest, CorrectsNewFeaturesAndThoseOfTheMapAlike) {
  SelfCalibration calibration(OdometryOptions(), Rig(Sensor::kMono));
  for (int i = 0; i < 50; ++i) calibration.Learn(LensErrorSeen(calibration, -0.02, 0.001), 10, &map_);
  const cv::Point2f fresh = calibration.Correct(OneFeature(600, 400))->keypoints[0].pt;
  const cv::Point2f old = map_.keyframe(0).features->keypoints[0].pt;
  EXPECT_LT(fresh.x, 598);  // towards the principal point
  EXPECT_NEAR(fresh.x, old.x, 1e-3);
  EXPECT_NEAR(fresh.y, old.y, 1e-3);
}

TEST_F(SelfCalibrationTest, WindowsThatHardlyKnowAreNotBelieved) {
  SelfCalibration calibration(OdometryOptions(), Rig(Sensor::kMono));
  for (int i = 0; i < 500; ++i) calibration.Learn(LensErrorSeen(calibration, -0.3, 0.08), 10, &map_);
  EXPECT_TRUE(calibration.Applied().isZero());
}

TEST_F(SelfCalibrationTest, IsOffWithDepthAndWhereToldSo) {
  EXPECT_FALSE(SelfCalibration(OdometryOptions(), Rig(Sensor::kRgbd)).Enabled());
  EXPECT_FALSE(SelfCalibration(OdometryOptions(), Rig(Sensor::kStereo)).Enabled());
  OdometryOptions options;
  options.lens_sigma = 0;
  SelfCalibration off(options, Rig(Sensor::kMono));
  EXPECT_FALSE(off.Enabled());
  const auto features = OneFeature(600, 400);
  EXPECT_EQ(off.Correct(features), features);
}

}  // namespace
}  // namespace tutti
