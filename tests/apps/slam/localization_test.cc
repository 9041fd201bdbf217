// Frames that are located in a map (Localizer).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <vector>

#include "tests/support/each_sensor.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/slam/localizer.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// The first lap through a small town is mapped; then come its end again, and a street that is new.
class LocatingFrames : public ::testing::TestWithParam<SyntheticSensor> {
 protected:
  static constexpr std::size_t kMapped = 110, kBack = 60, kEnd = 150;

  static SyntheticOptions Town() {
    SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
    options.sensor = GetParam();
    return options;
  }
  static RunConfig Config() {
    RunConfig config;
    config.odometry.features = 800;
    return config;
  }
  // A map of the first frames, and who locates in it.
  std::unique_ptr<SlamSystem> Mapped() const {
    const fs::path& file = MapFile();
    return LoadMap(file, ReadMapInfo(file));
  }
  // Each sensor's once for all tests.
  const fs::path& MapFile() const {
    static std::map<SyntheticSensor, fs::path> mapped;
    fs::path& file = mapped[GetParam()];
    if (!file.empty()) return file;
    file = testing::FreshFolder() / "map.tutti";
    SlamSystem slam(Config(), recording_.rig);
    for (std::size_t i = 0; i < kMapped; ++i) slam.Track(recording_.frames[i]);
    slam.Finish();
    slam.Snapshot().Write(file);
    return file;
  }

  const testing::RenderedWorld world_{Town()};
  const testing::Recording recording_ = testing::Record(world_, kEnd);
};

INSTANTIATE_TEST_SUITE_P(Sensors, LocatingFrames, testing::EachSensor(), testing::SensorName);

TEST_P(LocatingFrames, TheMapStaysAsItIsWhileTheCameraDrivesOnBeyondIt) {
  const auto map = Mapped();
  Localizer localizer(*map);
  const Odometry before = *map->odometry();
  const int keyframes = before.map().KeyframeCount();
  std::size_t found = 0, within = 0;
  for (std::size_t i = kBack; i < kEnd; ++i) {
    if (localizer.Track(recording_.frames[i]).state != TrackingState::kTracking) continue;
    ++found;
    if (localizer.odometry().LastView().beyond_map) continue;
    ++within;
    EXPECT_LT(localizer.odometry().LastView().keyframe, keyframes) << "frame " << i;
  }
  EXPECT_GE(found, (kEnd - kBack) * 9 / 10);
  EXPECT_GE(within, kMapped - kBack - 5);
  EXPECT_GT(localizer.odometry().map().KeyframeCount(), keyframes) << "keyframes for the time being";
  for (int id = 0; id < keyframes; ++id)
    EXPECT_EQ(localizer.odometry().map().keyframe(id).T_world_camera.Matrix(),
              before.map().keyframe(id).T_world_camera.Matrix())
        << id;
  const Map &old = before.map(), &now = localizer.odometry().map();
  std::size_t kept = 0;
  for (const int id : old.LandmarkIds()) {
    if (!now.landmark(id).alive) continue;  // it was found to be the same as another one of the map
    ++kept;
    EXPECT_EQ(now.landmark(id).position, old.landmark(id).position);
  }
  EXPECT_GE(kept, old.LandmarkIds().size() * 98 / 100);
}

TEST_P(LocatingFrames, NoMoreFeaturesAreSoughtThanThePoseNeeds) {
  const auto map = Mapped();
  Localizer localizer(*map);
  const int all = localizer.Track(recording_.frames[kBack]).features;
  int least = all, most_inliers = 0;
  for (std::size_t i = kBack + 1; i < kBack + 8; ++i) {
    const TrackResult result = localizer.Track(recording_.frames[i]);
    ASSERT_EQ(result.state, TrackingState::kTracking) << "frame " << i;
    EXPECT_FALSE(localizer.odometry().LastView().beyond_map) << "frame " << i;
    least = std::min(least, result.features);
    most_inliers = std::max(most_inliers, result.inliers);
  }
  std::printf("  %d to %d features, up to %d inliers\n", least, all, most_inliers);
  if (GetParam() != SyntheticSensor::kMono) {
    EXPECT_LT(least, 0.9 * all);
  }
  EXPECT_GT(most_inliers, 100);
  // Who has extracted features already gets what they tell.
  InputFrame frame = recording_.frames[kBack + 8];
  frame.features = localizer.odometry().Extract(frame);
  EXPECT_GT(localizer.Track(frame).features, 0.9 * all);
}

TEST_P(LocatingFrames, AfterACoveredLensTheCameraIsFoundAgainWithAllFeatures) {
  const auto map = Mapped();
  Localizer localizer(*map);
  constexpr std::size_t kCovered = kBack + 3, kFree = kBack + 6;
  for (std::size_t i = kBack; i < kCovered; ++i) localizer.Track(recording_.frames[i]);
  for (std::size_t i = kCovered; i < kFree; ++i)
    EXPECT_EQ(localizer.Track(testing::Black(recording_.frames[i])).state, TrackingState::kLost);
  const TrackResult again = localizer.Track(recording_.frames[kFree]);
  EXPECT_EQ(again.state, TrackingState::kTracking) << again.reason;
  EXPECT_GT(again.features, 500);
}

}  // namespace
}  // namespace tutti
