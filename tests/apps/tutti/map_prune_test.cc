// `tutti map prune`, through the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;

SyntheticOptions TwoLapsToPrune() {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.laps = 1.6;
  return options;
}

class MapPrune : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::copy(testing::RunMadeOnce(town_ / "config.yaml", town_, {"--no-report"}) / "map.tutti", map_);
  }
  const fs::path town_ = testing::GeneratedDataset(TwoLapsToPrune());
  const fs::path folder_ = testing::FreshFolder(), map_ = folder_ / "map.tutti",
                 small_ = folder_ / "small.tutti";
};

TEST_F(MapPrune, WritesASmallerMapAndSaysSoAndLeavesTheOtherAlone) {
  const std::string before = ReadAll(map_);
  const auto run = RunTutti({"map", "prune", map_, "-o", small_});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_EQ(ReadAll(map_) == before, true);
  const MapInfo large = ReadMapInfo(map_), small = ReadMapInfo(small_);
  EXPECT_LT(small.keyframes, large.keyframes);
  EXPECT_LE(small.landmarks, large.landmarks);
  EXPECT_EQ(small.frames, large.frames);
  EXPECT_EQ(small.note, large.note);
  EXPECT_LT(fs::file_size(small_), fs::file_size(map_));
  EXPECT_THAT(run.output, HasSubstr(std::to_string(large.keyframes) + " -> "));
  EXPECT_NO_THROW(CheckMapFile(small_));
  ASSERT_EQ(RunTutti({"map", "prune", map_}).status, 0);
  EXPECT_EQ(ReadAll(map_) == ReadAll(small_), true) << "in place it is the same";
  for (const char* action : {"info", "export"}) {
    const auto use =
        std::string(action) == "info"
            ? RunTutti({"map", "info", small_, "--check"})
            : RunTutti({"export", small_, "--g2o", folder_ / "graph.g2o", "--tum", folder_ / "poses.txt"});
    EXPECT_EQ(use.status, 0) << use.output;
  }
}

TEST_F(MapPrune, WhatIsNoFinishedMapIsRefusedByNameAndStays) {
  const fs::path absent = folder_ / "absent.tutti";
  const auto none = RunTutti({"map", "prune", absent});
  EXPECT_EQ(none.status, 1);
  EXPECT_THAT(none.output, HasSubstr(absent.string()));
  const fs::path checkpoint = folder_ / "checkpoint.tutti";
  const MapInfo info = ReadMapInfo(map_);
  LoadMap(map_, info)->Snapshot().Write(checkpoint, [](const MapSink& sink) { sink(300, "a run"); });
  const std::string before = ReadAll(checkpoint);
  const auto refused = RunTutti({"map", "prune", checkpoint});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.output, HasSubstr(checkpoint.string() + ": is a checkpoint"));
  EXPECT_EQ(ReadAll(checkpoint) == before, true);
  const auto nowhere = RunTutti({"map", "prune", map_, "-o", folder_ / "no" / "where.tutti"});
  EXPECT_EQ(nowhere.status, 1);
  EXPECT_THAT(nowhere.output, HasSubstr("where.tutti"));
}

}  // namespace
}  // namespace tutti
