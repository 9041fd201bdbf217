// The height above the ground keeps the scale of a map of one camera.
#include <gtest/gtest.h>

#include <cmath>

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

// How much the scale changes between the first and the last third of the way, as a logarithm.
double ScaleDrift(bool keep_height) {
  OdometryOptions options;
  options.keep_height = keep_height;
  options.lens_sigma = 0;
  const testing::Recording& recording = StraightRoad();
  Odometry odometry(options, recording.rig);
  for (const InputFrame& frame : recording.frames) odometry.Track(frame);
  odometry.FinishMapping();
  const Trajectory estimate = odometry.FrameTrajectory();
  const auto scale = [&](std::size_t from, std::size_t to) {
    const std::size_t offset = recording.truth.size() - estimate.size();
    return (estimate[to].pose.translation - estimate[from].pose.translation).norm() /
           (recording.truth[to + offset].pose.translation - recording.truth[from + offset].pose.translation)
               .norm();
  };
  const std::size_t n = estimate.size();
  return std::log(scale(n - 1 - n / 3, n - 1) / scale(0, n / 3));
}

TEST(KeepHeight, TakesHalfOfTheDriftOutOfAStraightRoad) {
  const double without = ScaleDrift(false), with = ScaleDrift(true);
  EXPECT_GT(std::abs(without), 0.01) << "else there is nothing to see here";
  EXPECT_LT(std::abs(with), 0.6 * std::abs(without));
}

}  // namespace
}  // namespace tutti
