// Processors with newer instructions fuse a multiplication and an addition, which rounds once instead of
// twice.
#include <gtest/gtest.h>

#include "tests/apps/slam/map_outcome.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

class AnyProcessor : public ::testing::TestWithParam<SyntheticSensor> {};
INSTANTIATE_TEST_SUITE_P(Sensors, AnyProcessor,
                         ::testing::Values(SyntheticSensor::kMono, SyntheticSensor::kStereo,
                                           SyntheticSensor::kRgbd));

testing::MapOutcome Driven(const testing::Recording& recording) {
  RunConfig config;
  config.odometry.features = 800;
  config.run.threads = 2;
  if (recording.rig.sensor != Sensor::kStereo) config.loops.members = {"orb"};  // the ensemble once is enough
  SlamSystem slam(config, recording.rig);
  for (const InputFrame& frame : recording.frames) slam.Track(frame);
  return testing::Finished(slam);
}

// AVX2 and FMA, where the processor has them, or plain x86-64.
TEST_P(AnyProcessor, InstructionsThatOpenCvMayUseChangeNoBitOfARun) {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.sensor = GetParam();
  const testing::RenderedWorld world(options);
  const testing::Recording recording = testing::Record(world, world.Size());
  const testing::MapOutcome all = Driven(recording);
  EXPECT_GT(all.corrections, 0);
  cv::setUseOptimized(false);
  const testing::MapOutcome plain = Driven(recording);
  cv::setUseOptimized(true);
  testing::ExpectTheSame(plain, all, "without them");
}

}  // namespace
}  // namespace tutti
