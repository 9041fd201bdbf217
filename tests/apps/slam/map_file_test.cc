// A run that was saved and goes on from the file is the run that never stopped.
#include "tutti/slam/map_file.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/apps/slam/map_outcome.h"
#include "tests/support/each_sensor.h"
#include "tests/support/error_of.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::ExpectTheSame;
using testing::Finished;
using testing::MapOutcome;

testing::Recording MappedDrive(SyntheticSensor sensor) {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.sensor = sensor;
  options.laps = 1.4;
  const testing::RenderedWorld world(options);
  return testing::Record(world, world.Size());
}

RunConfig MapConfig(int threads) {
  RunConfig config;
  config.odometry.features = 800;
  config.run.threads = threads;
  return config;
}

class MapFile : public ::testing::TestWithParam<SyntheticSensor> {};

// Saving disturbs nothing, either: the whole run was saved often, those that go on never.
TEST_P(MapFile, ARunThatGoesOnFromAnyFrameIsTheOneThatNeverStopped) {
  const testing::Recording recording = MappedDrive(GetParam());
  const fs::path folder = testing::FreshFolder();
  RunConfig config = MapConfig(2);
  if (GetParam() != SyntheticSensor::kStereo) config.loops.members = {"orb"};  // the ensemble once is enough
  SlamSystem whole(config, recording.rig);
  const std::size_t n = recording.frames.size();
  std::vector<std::size_t> saved;
  bool moved = false, adjusting = false;  // what was under way when something was saved
  std::size_t next = 3;                   // frame
  int corrections = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const bool just_moved = whole.Report().corrections > corrections;
    if (i == next || just_moved) {
      whole.Snapshot().Write(folder / std::to_string(i));
      saved.push_back(i);
      moved = moved || corrections > 0;
      adjusting = adjusting || whole.Report().global_adjustments < whole.Report().corrections;
      next = i + (just_moved ? 6 : 83);  // an adjustment takes 20 frames
    } else if (i % 9 == 0) {
      whole.Snapshot().Write(folder / "often");
    }
    corrections = whole.Report().corrections;
    whole.Track(recording.frames[i]);
  }
  const MapOutcome expected = Finished(whole);
  ASSERT_GT(expected.corrections, 0);
  EXPECT_GT(expected.adjustments, 0);
  EXPECT_TRUE(moved && adjusting) << "not all moments were tried";
  for (std::size_t s = 0; s < saved.size(); ++s) {
    const fs::path file = folder / std::to_string(saved[s]);
    MapInfo info = ReadMapInfo(file);
    EXPECT_EQ(info.frames, static_cast<std::int64_t>(saved[s]));
    info.config.run.threads = s % 2 == 0 ? 1 : 2;
    const auto slam = LoadMap(file, info);
    for (std::size_t i = saved[s]; i < n; ++i) slam->Track(recording.frames[i]);
    ExpectTheSame(Finished(*slam), expected, "from frame " + std::to_string(saved[s]));
  }
}

// What the file of the long-term memory holds is then of later than the map.
TEST(MapFileWithLongTermMemory, GoesOnFromTheMapWhateverTheMemorysFileHasSeenSince) {
  const testing::Recording recording = MappedDrive(SyntheticSensor::kStereo);
  const fs::path folder = testing::FreshFolder();
  const auto configured = [&](const char* file) {
    RunConfig config = MapConfig(2);
    config.loops.wm_limit = 12;
    config.loops.ltm_file = (folder / file).string();
    return config;
  };
  const std::size_t n = recording.frames.size(), k = n / 2, crash = k + 30;
  SlamSystem whole(configured("whole.ltm"), recording.rig);
  {
    SlamSystem broken_off(configured("broken.ltm"), recording.rig);
    for (std::size_t i = 0; i < crash; ++i) {
      if (i == k) broken_off.Snapshot().Write(folder / "map");
      broken_off.Track(recording.frames[i]);
    }
  }
  for (const InputFrame& frame : recording.frames) whole.Track(frame);
  MapInfo info = ReadMapInfo(folder / "map");
  info.config.loops.ltm_file = info.ltm_file;
  const auto slam = LoadMap(folder / "map", info);
  for (std::size_t i = k; i < n; ++i) slam->Track(recording.frames[i]);
  ExpectTheSame(Finished(*slam), Finished(whole), "with a long-term memory");
  EXPECT_EQ(info.ltm_file, (folder / "broken.ltm").string());
}

INSTANTIATE_TEST_SUITE_P(Sensors, MapFile, testing::EachSensor(), testing::SensorName);

class DamagedMap : public ::testing::Test {
 protected:
  static std::string Content(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return std::string((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  }
  // What loading says.
  std::string Refusal(const std::string& bytes) const {
    std::ofstream(file_, std::ios::binary | std::ios::trunc) << bytes;
    return testing::ErrorOf([&] { LoadMap(file_, ReadMapInfo(file_)); });
  }
  void SaveSome(std::size_t frames = 30) const {
    const testing::Recording recording =
        testing::Record(testing::RenderedWorld(testing::SmallStereoTown(320, 160)), frames);
    SlamSystem slam(MapConfig(1), recording.rig);
    for (const InputFrame& frame : recording.frames) slam.Track(frame);
    slam.Snapshot().Write(file_);
  }
  fs::path file_ = testing::FreshFolder() / "some.tutti";
};

TEST_F(DamagedMap, IsRefusedByNameWhereverItIsDamaged) {
  SaveSome(10);  // each part of a map, and no more than that of each
  const std::string bytes = Content(file_);
  ASSERT_GT(ReadMapInfo(file_).keyframes, 2);
  ASSERT_EQ(Refusal(bytes), "no error");
  constexpr std::size_t kVariants = 400;
  for (std::size_t v = 0; v < kVariants; ++v) {
    const std::size_t at = v < 20 ? v : v * (bytes.size() - 1) / (kVariants - 1);
    const std::string cut = Refusal(bytes.substr(0, at));
    EXPECT_NE(cut.find(file_.string()), std::string::npos) << "cut at " << at << ": " << cut;
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ (1 << (v % 8)));
    const std::string flipped = Refusal(changed);
    EXPECT_NE(flipped.find(file_.string()), std::string::npos) << "changed at " << at << ": " << flipped;
  }
}

// Whoever gives a map away would decide which file is written where it is loaded.
TEST_F(DamagedMap, NamesNoFileThatIsWritten) {
  const fs::path memory = file_.parent_path() / "memory.ltm";
  RunConfig config = MapConfig(1);
  config.loops.ltm_file = memory.string();
  const testing::Recording recording =
      testing::Record(testing::RenderedWorld(testing::SmallStereoTown(320, 160)), 10);
  {
    SlamSystem slam(config, recording.rig);
    for (const InputFrame& frame : recording.frames) slam.Track(frame);
    slam.Snapshot().Write(file_);
  }
  fs::remove(memory);
  const MapInfo info = ReadMapInfo(file_);
  EXPECT_EQ(info.config.loops.ltm_file, "");
  EXPECT_EQ(info.ltm_file, memory.string());
  const auto slam = LoadMap(file_, info);
  slam->BeginSession(recording.rig);
  for (const InputFrame& frame : recording.frames) slam->Track(frame);
  EXPECT_EQ(std::distance(fs::directory_iterator(file_.parent_path()), fs::directory_iterator()), 1);
}

TEST_F(DamagedMap, ASnapshotIsWrittenAfterItsSlamSystemIsGone) {
  const testing::Recording recording =
      testing::Record(testing::RenderedWorld(testing::SmallStereoTown(320, 160)), 12);
  for (const int threads : {1, 2}) {
    std::optional<MapSnapshot> snapshot;
    {
      SlamSystem slam(MapConfig(threads), recording.rig);
      for (const InputFrame& frame : recording.frames) slam.Track(frame);
      snapshot.emplace(slam.Snapshot());
    }  // while the detector looks at the last keyframes
    snapshot->Write(file_);
    CheckMapFile(file_);
    const auto again = LoadMap(file_, ReadMapInfo(file_));
    EXPECT_EQ(FrameTrajectory(again->odometry()->map()).size(), recording.frames.size());
    const MapSnapshot moved = std::move(*snapshot);
    moved.Write(file_);
    const std::string before = Content(file_);
    EXPECT_NE(testing::ErrorOf([&] { snapshot->Write(file_); }).find(file_.string()), std::string::npos);
    EXPECT_EQ(Content(file_) == before, true);
  }
}

TEST_F(DamagedMap, WithItselfOrNoneCantBeMerged) {
  const testing::Recording recording =
      testing::Record(testing::RenderedWorld(testing::SmallStereoTown(320, 160)), 3);
  SlamSystem slam(MapConfig(1), recording.rig);
  for (const InputFrame& frame : recording.frames) slam.Track(frame);
  for (SlamSystem* other : {&slam, static_cast<SlamSystem*>(nullptr)})
    EXPECT_NE(testing::ErrorOf([&] { Merge(&slam, other); }).find("merged with itself"), std::string::npos);
}

TEST_F(DamagedMap, ANewerVersionIsSaidAndSomethingElseIsNoMap) {
  SaveSome();
  std::string newer = Content(file_);
  newer[8] = 77;
  EXPECT_NE(Refusal(newer).find("version 77"), std::string::npos);
  EXPECT_NE(Refusal("no map at all, but long enough to be one").find("is no map"), std::string::npos);
  EXPECT_THROW(ReadMapInfo(file_.parent_path() / "absent"), InputError);
}

TEST_F(DamagedMap, WhatCantBeWrittenLeavesTheOldOne) {
  SaveSome();
  const std::string before = Content(file_);
  const testing::Recording recording =
      testing::Record(testing::RenderedWorld(testing::SmallStereoTown(320, 160)), 3);
  const SlamSystem slam(MapConfig(1), recording.rig);
  EXPECT_THROW(slam.Snapshot().Write(file_, [](const MapSink&) { throw InputError("stop"); }), InputError);
  EXPECT_EQ(Content(file_) == before, true);
  EXPECT_THROW(slam.Snapshot().Write(file_ / "no" / "folder"), InputError);
  EXPECT_EQ(std::distance(fs::directory_iterator(file_.parent_path()), fs::directory_iterator()), 1);
}

TEST_F(DamagedMap, TheInfoSaysWhatIsInside) {
  SaveSome();
  const MapInfo info = ReadMapInfo(file_);
  EXPECT_EQ(info.frames, 30);
  EXPECT_GT(info.keyframes, 2);
  EXPECT_GT(info.landmarks, 100);
  EXPECT_EQ(info.pieces, 1);
  EXPECT_EQ(info.rig.sensor, Sensor::kStereo);
  EXPECT_EQ(info.config.odometry.features, 800);
  EXPECT_GT((info.most - info.least).norm(), 0.5);
}

}  // namespace
}  // namespace tutti
