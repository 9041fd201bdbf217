// What trajectory_odometry.txt is made of: the odometry from before loops first changed it, tracked on, is
// the odometry that never saw a loop.
#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "tests/support/recording.h"
#include "tests/support/small_town.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

class UntouchedOdometry : public ::testing::TestWithParam<std::tuple<SyntheticSensor, int>> {};

TEST_P(UntouchedOdometry, TrackedOnHasTheBitsOfTheOdometryAlone) {
  const auto [sensor, planted] = GetParam();
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.sensor = sensor;
  const SyntheticWorld world(options);
  const testing::Recording recording = testing::Record(world, world.Size());
  RunConfig config;
  config.odometry.features = 800;
  config.run.threads = 2;
  config.run.inject_false_loops = planted;
  config.run.loops = planted == 0;  // else the first change is a planted loop

  SlamSystem slam(config, recording.rig);
  Odometry alone(config.odometry, recording.rig);
  for (const InputFrame& frame : recording.frames) {
    slam.Track(frame);
    alone.Track(frame);
  }
  slam.Finish();
  alone.FinishMapping();
  Odometry* untouched = slam.untouched();
  ASSERT_NE(untouched, nullptr) << "no loop changed anything";
  for (const InputFrame& frame : recording.frames) {
    if (frame.index > slam.UntouchedLast()) untouched->Track(frame);
  }
  untouched->FinishMapping();
  const Trajectory a = alone.FrameTrajectory(), b = untouched->FrameTrajectory();
  ASSERT_EQ(a.size(), b.size());
  ASSERT_GT(a.size(), recording.frames.size() / 3);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].pose.Matrix(), b[i].pose.Matrix()) << i;
}

std::string NameOf(const ::testing::TestParamInfo<UntouchedOdometry::ParamType>& tested) {
  const auto [sensor, planted] = tested.param;
  const std::string name = sensor == SyntheticSensor::kMono     ? "Mono"
                           : sensor == SyntheticSensor::kStereo ? "Stereo"
                                                                : "RgbD";
  return name + (planted > 0 ? "WithPlantedLoops" : "");
}

INSTANTIATE_TEST_SUITE_P(EverySensor, UntouchedOdometry,
                         ::testing::Combine(::testing::Values(SyntheticSensor::kMono,
                                                              SyntheticSensor::kStereo,
                                                              SyntheticSensor::kRgbd),
                                            ::testing::Values(0, 2)),
                         NameOf);

}  // namespace
}  // namespace tutti
