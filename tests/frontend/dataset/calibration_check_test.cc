// Deliberately wrong calibrations of a synthetic world, and the real sets, which must pass.
#include "tutti/frontend/calibration_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "frontend/dataset/rectified_rig.h"
#include "tests/support/rendered_world.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

/// Stereo frames of the synthetic town.
struct Town {
  CameraRig rig;
  std::vector<InputFrame> frames;
};

const Town& StereoTown() {
  static const Town town = [] {
    SyntheticOptions options;
    options.sensor = SyntheticSensor::kStereo;
    options.width = 480;
    options.height = 240;
    options.supersample = 1;
    options.frames = 40;
    const testing::RenderedWorld world(options);
    Town out;
    out.rig.sensor = Sensor::kStereo;
    out.rig.camera = world.Camera();
    out.rig.baseline_m = world.Options().baseline_m;
    for (const std::size_t i : {0, 20}) {
      const SyntheticFrame rendered = world.Render(i);
      InputFrame frame;
      frame.image = rendered.image;
      frame.right = rendered.right;
      out.frames.push_back(std::move(frame));
    }
    return out;
  }();
  return town;
}

std::string Advice(const CalibrationReport& report) {
  return report.findings.empty() ? "" : report.findings.front().advice;
}

TEST(CalibrationCheck, ARightCalibrationPasses) {
  const CalibrationReport report = CheckCalibration(StereoTown().rig, StereoTown().frames);
  EXPECT_EQ(Advice(report), "");
  EXPECT_GT(report.stereo_matches, 100);
  EXPECT_LT(report.row_error_px, 1);
  EXPECT_LT(report.swapped, 0.1);
}

TEST(CalibrationCheck, SwappedImagesAreSeen) {
  std::vector<InputFrame> frames = StereoTown().frames;
  for (InputFrame& frame : frames) std::swap(frame.image, frame.right);
  const CalibrationReport report = CheckCalibration(StereoTown().rig, frames);
  EXPECT_GT(report.swapped, 0.9);
  EXPECT_THAT(Advice(report), HasSubstr("swapped"));
}

TEST(CalibrationCheck, PairsThatAreNotRectifiedAreSeen) {
  std::vector<InputFrame> frames = StereoTown().frames;
  for (InputFrame& frame : frames) {  // the right camera is turned by 2 deg about its axis, and 3 px down
    const cv::Point2f centre(0.5F * static_cast<float>(frame.right.cols),
                             0.5F * static_cast<float>(frame.right.rows));
    cv::Mat turn = cv::getRotationMatrix2D(centre, 2.0, 1.0);
    turn.at<double>(1, 2) += 3;
    cv::Mat turned;
    cv::warpAffine(frame.right, turned, turn, frame.right.size(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    frame.right = turned;
  }
  const CalibrationReport report = CheckCalibration(StereoTown().rig, frames);
  EXPECT_LT(report.same_row, 0.5);
  EXPECT_THAT(Advice(report), HasSubstr("not rectified"));
}

TEST(CalibrationCheck, ImplausibleLensesAreSeen) {
  const PinholeCamera& c = StereoTown().rig.camera;
  const cv::Size size(c.width, c.height);
  for (const auto& [camera, advice] :
       {std::pair(Pinhole(4.5, 4.5, c.cx, c.cy, size), "in pixels"),  // millimetres
        {Pinhole(12 * c.fx, 12 * c.fy, c.cx, c.cy, size), "this very image size"},
        {Pinhole(c.fx, 2 * c.fy, c.cx, c.cy, size), "almost square"},
        {Pinhole(c.fx, c.fy, 1.6 * c.cx, c.cy, size), "another image size"}}) {  // of a wider image
    CameraRig rig = StereoTown().rig;
    rig.camera = camera;
    EXPECT_THAT(Advice(CheckCalibration(rig, {})), HasSubstr(advice));
  }
}

TEST(CalibrationCheck, WrongDepthUnitsAreSeen) {
  CameraRig rig = StereoTown().rig;
  rig.sensor = Sensor::kRgbd;
  InputFrame frame;
  frame.depth_m = cv::Mat(240, 480, CV_32FC1, cv::Scalar(2.0));
  EXPECT_EQ(Advice(CheckCalibration(rig, {frame})), "");
  frame.depth_m.setTo(2000.0);  // millimetres taken for metres
  EXPECT_THAT(Advice(CheckCalibration(rig, {frame})), HasSubstr("depth_units_per_m"));
  frame.depth_m.setTo(0.0);
  EXPECT_THAT(Advice(CheckCalibration(rig, {frame})), HasSubstr("max_depth_m"));
}

TEST(CalibrationCheck, NoCalibrationHasNoFindingAndWrongOptionsAreRefused) {
  CameraRig rig;
  rig.calibrated = false;
  EXPECT_TRUE(CheckCalibration(rig, {}).findings.empty());
  CalibrationCheckOptions options;
  options.min_matches = 0;
  EXPECT_ANY_THROW(CheckCalibration(rig, {}, options));
}

TEST(CalibrationCheck, RealSetsPass) {
  TUTTI_REQUIRE_DATA(euroc, "euroc_v101_head");
  TUTTI_REQUIRE_DATA(kitchen, "redkitchen");
  TUTTI_REQUIRE_DATA(kitti, "kitti_00_head");
  DatasetOptions stereo;
  stereo.sensor = Sensor::kStereo;
  const CalibrationReport pairs = CheckCalibration(*OpenDataset(euroc, stereo));
  EXPECT_EQ(Advice(pairs), "");
  EXPECT_GT(pairs.same_row, 0.9);
  DatasetOptions rgbd;
  rgbd.sensor = Sensor::kRgbd;
  rgbd.camera = Pinhole(520, 520, 318, 236, {640, 480});
  EXPECT_EQ(Advice(CheckCalibration(*OpenDataset(kitchen, rgbd))), "");
  DatasetOptions mono;
  mono.camera = Pinhole(718.856, 718.856, 607.1928, 185.2157, {1241, 376});
  EXPECT_EQ(Advice(CheckCalibration(*OpenDataset(kitti, mono))), "");
}

}  // namespace
}  // namespace tutti
