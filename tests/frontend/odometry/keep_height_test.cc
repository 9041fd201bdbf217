// The height above the ground keeps the scale of a map of one camera.
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>

#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tutti/frontend/odometry.h"

namespace tutti {
namespace {

// 130 m straight on.
const testing::Recording& StraightRoad() {
  static const testing::Recording recording = [] {
    SyntheticOptions options;
    options.sensor = SyntheticSensor::kMono;
    options.width = 400;
    options.height = 200;
    options.supersample = 1;
    options.block_m = 160;
    options.frames = 170;
    return testing::Record(testing::RenderedWorld(options), 170);
  }();
  return recording;
}

// How much the scale changes between the first and the last third of the way, as a logarithm, if the images
// have a radial distortion `k1` that the odometry is not told.
double ScaleDrift(double k1, bool keep_height) {
  OdometryOptions options;
  options.keep_height = keep_height;
  options.lens_sigma = 0;
  const testing::Recording& recording = StraightRoad();
  Odometry odometry(options, recording.rig);
  const PinholeCamera& camera = recording.rig.camera;
  const cv::Matx33d k(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  for (InputFrame frame : recording.frames) {
    cv::Mat image;
    cv::undistort(frame.image, image, k, cv::Vec4d(k1, 0, 0, 0));
    frame.image = image;
    odometry.Track(frame);
  }
  odometry.FinishMapping();
  const Trajectory estimate = FrameTrajectory(odometry.map());
  const auto scale = [&](std::size_t from, std::size_t to) {
    const std::size_t offset = recording.truth.size() - estimate.size();
    return (estimate[to].pose.translation - estimate[from].pose.translation).norm() /
           (recording.truth[to + offset].pose.translation - recording.truth[from + offset].pose.translation)
               .norm();
  };
  const std::size_t n = estimate.size();
  return std::log(scale(n - 1 - n / 3, n - 1) / scale(0, n / 3));
}

TEST(KeepHeight, TakesAThirdOrMoreOutOfTheDriftThatAWrongLensGives) {
  const double without = ScaleDrift(0.02, false), with = ScaleDrift(0.02, true);
  EXPECT_GT(std::abs(without), 0.03) << "else there is nothing to see here";
  EXPECT_LT(std::abs(with), 0.67 * std::abs(without));
}

}  // namespace
}  // namespace tutti
