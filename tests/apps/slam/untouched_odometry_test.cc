// What trajectory_odometry.txt is made of: the odometry from before loops first changed it, tracked on, is
// the odometry that never saw a loop.
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

enum class Change { kLoopsMoveTheMap, kTheMapFulfilsTheLoops, kFalseLoopsAreRefused, kALostFrameIsFound };

class UntouchedOdometry : public ::testing::TestWithParam<std::tuple<SyntheticSensor, Change>> {};

// A lap and a bit; or 120 frames, and then some of them once more.
testing::Recording Drive(SyntheticSensor sensor, Change change) {
  SyntheticOptions options = change == Change::kALostFrameIsFound
                                 ? testing::SmallStereoTown(320, 160)
                                 : testing::SmallStereoTownWithALoop(320, 160);
  options.sensor = sensor;
  const testing::RenderedWorld world(options);
  if (change != Change::kALostFrameIsFound) return testing::Record(world, world.Size());
  testing::Recording recording = testing::Record(world, 120);
  for (std::size_t i = 10; i < 60; ++i) {
    InputFrame again = recording.frames[i];
    again.index = static_cast<std::int64_t>(recording.frames.size());
    again.stamp_s = recording.frames.back().stamp_s + 1 / world.Options().rate_hz;
    recording.frames.push_back(again);
  }
  return recording;
}

RunConfig ConfiguredFor(Change change) {
  RunConfig config;
  config.odometry.features = 800;
  config.run.threads = 2;
  config.loops.members = {"orb"};  // who finds the loops makes no difference here, but to the time
  config.run.loops = change != Change::kFalseLoopsAreRefused;
  if (change == Change::kTheMapFulfilsTheLoops) {
    config.run.loop_defer_fraction = 100;
    config.run.loop_defer_deg = 180;
  }
  return config;
}

// The three changes of the map see the same recording, and so does the odometry alone.
struct Alone {
  testing::Recording recording;
  Trajectory trajectory;
};

const Alone& AloneOn(SyntheticSensor sensor, Change change) {
  static std::map<std::pair<SyntheticSensor, bool>, Alone> tracked;
  const std::pair key(sensor, change == Change::kALostFrameIsFound);
  const auto known = tracked.find(key);
  if (known != tracked.end()) return known->second;
  Alone alone;
  alone.recording = Drive(sensor, change);
  Odometry odometry(ConfiguredFor(change).odometry, alone.recording.rig);
  for (const InputFrame& frame : alone.recording.frames) odometry.Track(frame);
  odometry.FinishMapping();
  alone.trajectory = FrameTrajectory(odometry.map());
  return tracked.emplace(key, std::move(alone)).first->second;
}

TEST_P(UntouchedOdometry, TrackedOnHasTheBitsOfTheOdometryAlone) {
  const auto [sensor, change] = GetParam();
  const testing::Recording& recording = AloneOn(sensor, change).recording;
  const RunConfig config = ConfiguredFor(change);
  SlamSystem slam(config, recording.rig);
  std::optional<Odometry> untouched;
  std::int64_t seen = -1;
  SlamListeners listeners;
  listeners.on_change = [&](const Odometry& odometry, std::int64_t last) {
    if (untouched) return;
    untouched = odometry;
    seen = last;
  };
  slam.SetListeners(listeners);
  bool planted = false;
  for (const InputFrame& frame : recording.frames) {
    slam.Track(frame);
    const std::vector<int> ids = slam.odometry()->map().KeyframeIds();
    if (planted || change != Change::kFalseLoopsAreRefused || ids.size() < 12) continue;
    slam.AddLoop(ids[1], ids[9], Similarity(1, ExpSO3({0, 1, 0}), {3, 4, 5}), MakeInformation(0.01, 0.01));
    planted = true;
  }
  slam.Finish();
  if (change == Change::kALostFrameIsFound && sensor != SyntheticSensor::kMono) {
    ASSERT_GT(slam.Report().relocalized, 0u);
  }
  if (change == Change::kFalseLoopsAreRefused) {
    ASSERT_EQ(CountAccepted(slam.loops()), 0u);
  }
  ASSERT_TRUE(untouched) << "nothing changed the odometry";
  for (const InputFrame& frame : recording.frames) {
    if (frame.index > seen) untouched->Track(frame);
  }
  untouched->FinishMapping();
  const Trajectory &a = AloneOn(sensor, change).trajectory, b = FrameTrajectory(untouched->map());
  ASSERT_EQ(a.size(), b.size());
  ASSERT_GT(a.size(), recording.frames.size() / 3);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].pose.Matrix(), b[i].pose.Matrix()) << i;
}

std::string NameOf(const ::testing::TestParamInfo<UntouchedOdometry::ParamType>& tested) {
  const auto [sensor, change] = tested.param;
  const char* changes[] = {"LoopsMoveTheMap", "TheMapFulfilsTheLoops", "FalseLoopsAreRefused",
                           "ALostFrameIsFound"};
  const std::string name = sensor == SyntheticSensor::kMono     ? "Mono"
                           : sensor == SyntheticSensor::kStereo ? "Stereo"
                                                                : "RgbD";
  return name + changes[static_cast<int>(change)];
}

INSTANTIATE_TEST_SUITE_P(
    EverySensor, UntouchedOdometry,
    ::testing::Combine(::testing::Values(SyntheticSensor::kMono, SyntheticSensor::kStereo,
                                         SyntheticSensor::kRgbd),
                       ::testing::Values(Change::kLoopsMoveTheMap, Change::kTheMapFulfilsTheLoops,
                                         Change::kFalseLoopsAreRefused, Change::kALostFrameIsFound)),
    NameOf);

}  // namespace
}  // namespace tutti
