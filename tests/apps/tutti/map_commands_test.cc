// Several recordings in one map file (`tutti run --map`, `tutti merge`), `tutti localize`, `tutti map prune`,
// and example 06.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/in_folder.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunProgramAndSignal;
using testing::RunTutti;

SyntheticOptions Town(std::uint64_t seed) {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.laps = 1.4;
  options.seed = seed;
  return options;
}

class SessionsCommand : public ::testing::Test {
 protected:
  testing::ProcessResult Run(const fs::path& town, const fs::path& out,
                             const std::vector<std::string>& more) const {
    return RunTutti({"run", "--dataset", town, "--out", out, "--quiet"}, more);
  }
  // Sessions in colours, a ring where this one was found in the map, and loops from one to the other.
  void ExpectItIsSeen(const fs::path& out) const {
    const std::string plot = ReadAll(out / "trajectory.svg");
    EXPECT_THAT(plot, HasSubstr("session 1"));
    EXPECT_THAT(plot, HasSubstr("found in the map (1)"));
    const json report = json::parse(ReadAll(out / "report.json"));
    EXPECT_EQ(report["earlier"].size(), 1u);
    ASSERT_EQ(report["found"].size(), 1u);
    EXPECT_EQ(report["found"][0]["frame"], Summary(out)["map"]["joined_at_frame"]);
    EXPECT_EQ(report["found"][0]["p"].size(), 3u);
    std::size_t between = 0;
    for (const json& loop : report["loops"]) {
      if (loop["candidate"] >= 100000 || loop["outcome"] != "accepted") continue;
      EXPECT_TRUE(loop.contains("a") && loop.contains("b")) << loop;
      ++between;
    }
    EXPECT_GT(between, 0u);
  }
  static std::string Config(const fs::path& town) { return (town / "config.yaml").string(); }
  static json Summary(const fs::path& out) { return json::parse(ReadAll(out / "summary.json")); }

  const fs::path town_ = testing::GeneratedDataset(Town(1));
  const fs::path folder_ = testing::FreshFolder(), day_ = folder_ / "day", next_ = folder_ / "next";
};

TEST_F(SessionsCommand, ARunGoesOnInTheMapOfAnotherAndBothAreInTheNewOne) {
  Done(Run(town_, day_, {"--config", Config(town_), "--end", "150", "--no-report"}));
  const std::string map = (day_ / "map.tutti").string();
  const std::string before = ReadAll(map);
  const auto next = Run(town_, next_, {"--map", map, "--start", "150"});  // with the map's configuration
  ExpectItIsSeen(next_);
  ASSERT_EQ(next.status, 0) << next.output;
  EXPECT_THAT(next.output, HasSubstr("in the map " + map));
  EXPECT_EQ(ReadAll(map) == before, true);
  const json summary = Summary(next_);
  EXPECT_EQ(summary["map"]["joined"], true);
  EXPECT_GE(static_cast<int>(summary["map"]["joined_at_frame"]), 150);
  EXPECT_EQ(summary["map"]["sessions"].size(), 2u);
  EXPECT_EQ(summary["map"]["frame_offset"], 100000);
  // Its frames, in the frame of reference of the map, which begins where the truth does.
  const Trajectory found = ReadTrajectory(next_ / "trajectory.txt", TrajectoryFormat::kTum);
  EXPECT_EQ(found.size(), static_cast<std::size_t>(summary["frames"]["tracked"]));
  const Trajectory truth = ReadTrajectory(town_ / "poses.txt", TrajectoryFormat::kKitti);
  EXPECT_GE(found.size(), (truth.size() - 150) * 9 / 10);
  double worst = 0;
  for (const StampedPose& pose : found) {
    const auto frame = static_cast<std::size_t>(std::lround(pose.stamp_s * 4.5));
    const Eigen::Vector3d expected = truth.front().pose.Inverse() * truth.at(frame).pose.translation;
    worst = std::max(worst, (pose.pose.translation - expected).norm());
  }
  EXPECT_LT(worst, 1.5);
  const json info = json::parse(RunTutti({"map", "info", next_ / "map.tutti", "--json"}).output);
  ASSERT_EQ(info["sessions"].size(), 2u);
  EXPECT_EQ(info["sessions"][0]["first_keyframe"], 0);
  EXPECT_EQ(info["sessions"][1]["last_keyframe"], static_cast<int>(info["keyframes"]) - 1);
  EXPECT_EQ(info["submaps"], 1);
  for (const auto& [session, frames] : {std::pair("1", 150u), std::pair("2", 0u)}) {
    const fs::path tum = folder_ / (std::string("of") + session + ".tum");
    Done(RunTutti({"export", next_, "--tum", tum, "--session", session}));
    const std::size_t poses = ReadTrajectory(tum, TrajectoryFormat::kTum).size();
    EXPECT_EQ(poses, frames > 0 ? frames : found.size());
  }
}

// With one member: the ensemble is in the test above.
TEST_F(SessionsCommand, MapsAreMergedWhereTheyShowTheSameAndRefusedWhereNot) {
  const auto mapped = [&](const fs::path& town, const fs::path& out, std::vector<std::string> frames) {
    const std::vector<std::string> more = {"--config", Config(town), "--set", "loops.members=[orb]",
                                           "--no-report"};
    frames.insert(frames.end(), more.begin(), more.end());
    return Run(town, out, frames).status;
  };
  ASSERT_EQ(mapped(town_, day_, {"--end", "130"}), 0);
  ASSERT_EQ(mapped(town_, next_, {"--start", "90", "--end", "190"}), 0);
  const std::string day = (day_ / "map.tutti").string(), next = (next_ / "map.tutti").string(),
                    both = (folder_ / "both.tutti").string();
  EXPECT_THAT(Done(RunTutti({"merge", day, next, "-o", both})), HasSubstr("2 sessions"));
  const json info = json::parse(RunTutti({"map", "info", both, "--json", "--check"}).output);
  EXPECT_EQ(info["sessions"].size(), 2u);
  EXPECT_EQ(info["submaps"], 1);
  EXPECT_EQ(info["frames"], 230);
  Done(RunTutti({"localize", "--map", both, "--dataset", town_, "--start", "150", "--end", "180", "--out",
                 folder_ / "where"}));

  const fs::path other = testing::GeneratedDataset(Town(7));
  const fs::path elsewhere = folder_ / "elsewhere";
  ASSERT_EQ(mapped(other, elsewhere, {"--end", "60"}), 0);
  const std::string none = (folder_ / "none.tutti").string();
  ExpectRefusal(RunTutti({"merge", day, elsewhere / "map.tutti", "-o", none}), {"shows no place of"});
  EXPECT_FALSE(fs::exists(none));
  EXPECT_EQ(RunTutti({"merge", day, next, "-o", day}).status, 1);
  fs::create_symlink(day, folder_ / "link.tutti");
  fs::create_hard_link(day, folder_ / "hard.tutti");
  fs::copy_file(day, folder_ / "copy.tutti");
  for (const fs::path& same : {fs::path(day), day_ / "." / "map.tutti", folder_ / "link.tutti",
                               folder_ / "hard.tutti", folder_ / "copy.tutti"}) {
    ExpectRefusal(RunTutti({"merge", day, same, "-o", none}),
                  {"are the same map; give the maps of two recordings"});
    EXPECT_FALSE(fs::exists(none));
  }
  // A run that goes on there says that it stands apart.
  const auto apart = Run(other, folder_ / "apart", {"--map", day, "--end", "40", "--no-report"});
  EXPECT_EQ(apart.status, 0) << apart.output;
  EXPECT_THAT(apart.output, HasSubstr("not joined with the map"));
  EXPECT_EQ(Summary(folder_ / "apart")["map"]["joined"], false);
}

TEST_F(SessionsCommand, WhatCantGoOnIsRefused) {
  ASSERT_EQ(Run(town_, day_, {"--config", Config(town_), "--end", "30", "--no-loops", "--no-report"}).status,
            0);
  ExpectRefusal(Run(town_, next_, {"--map", day_ / "map.tutti"}), {"without loop closure"});
  ExpectRefusal(Run(town_, day_, {"--map", day_ / "map.tutti", "--config", Config(town_)}),
                {"choose another --out"});
}

SyntheticOptions TownToLocalizeIn(std::uint64_t seed) {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.laps = 1.6;
  options.seed = seed;
  return options;
}

class LocalizeCommand : public ::testing::Test {
 protected:
  testing::ProcessResult Localize(const fs::path& dataset, const std::vector<std::string>& more) const {
    return RunTutti({"localize", "--map", map_, "--dataset", dataset, "--out", out_}, more);
  }
  static constexpr int kMapped = 175;  // of the frames: one lap
  const fs::path town_ = testing::GeneratedDataset(TownToLocalizeIn(1));
  const fs::path run_ = testing::RunMadeOnce(town_ / "config.yaml", town_,
                                             {"--end", std::to_string(kMapped), "--no-report"}),
                 map_ = run_ / "map.tutti", out_ = testing::FreshFolder() / "out";
};

TEST_F(LocalizeCommand, FramesOfASecondLapAreFoundInTheMapOfTheFirstWhichStaysAsItIs) {
  const std::string before = ReadAll(map_);
  Done(Localize(town_, {"--start", std::to_string(kMapped)}));
  EXPECT_EQ(ReadAll(map_) == before, true) << "the map's bytes have changed";
  const auto summary = testing::ReadJson(out_ / "summary.json");
  const double total = summary["frames"]["total"], localized = summary["frames"]["localized"];
  EXPECT_GE(localized, 0.95 * total);
  EXPECT_LT(static_cast<double>(summary["time"]["first_pose_s"]), 60);
  // The world is the map's, whose first camera is where the truth begins.
  const Trajectory found = ReadTrajectory(out_ / "trajectory.txt", TrajectoryFormat::kTum);
  EXPECT_EQ(static_cast<double>(found.size()), localized);
  const Trajectory truth = ReadTrajectory(town_ / "poses.txt", TrajectoryFormat::kKitti);
  double worst = 0;
  for (const StampedPose& pose : found) {
    const auto frame = static_cast<std::size_t>(std::lround(pose.stamp_s * 4.5));
    const Eigen::Vector3d expected = truth.front().pose.Inverse() * truth[frame].pose.translation;
    worst = std::max(worst, (pose.pose.translation - expected).norm());
  }
  EXPECT_LT(worst, 1.5);
  std::printf("  %.0f of %.0f frames, worst %.2f m\n", localized, total, worst);
  // Each frame has a line, with how sure it is.
  const std::string csv = ReadAll(out_ / "localization.csv");
  EXPECT_THAT(csv, ::testing::StartsWith("frame,stamp_s,state,recognised,keyframe,inliers,position_sigma_m"));
  EXPECT_EQ(static_cast<double>(std::count(csv.begin(), csv.end(), '\n')), total + 1);
  EXPECT_THAT(ReadAll(out_ / "localization.svg"), HasSubstr("beyond the map"));
}

TEST_F(LocalizeCommand, MapAndRecordingAreEnough) {
  const std::string town = fs::absolute(town_), map = fs::absolute(map_);
  const testing::InFolder here(testing::FreshFolder());
  const std::string run = Done(RunTutti({"localize", town, "--map", map, "--start", "180", "--end", "184"}));
  EXPECT_TRUE(fs::exists("tutti-out/" + town_.filename().string() + "-localized/trajectory.txt")) << run;
}

TEST_F(LocalizeCommand, TheResultDoesNotDependOnTheThreads) {
  const std::string start = std::to_string(kMapped + 20);
  ASSERT_EQ(Localize(town_, {"--start", start, "--threads", "1"}).status, 0);
  const std::string one = ReadAll(out_ / "trajectory.txt");
  ASSERT_EQ(Localize(town_, {"--start", start, "--threads", "2"}).status, 0);
  EXPECT_EQ(ReadAll(out_ / "trajectory.txt") == one, true);
}

TEST_F(LocalizeCommand, InTheMapOfAnotherTownNoFrameIsFound) {
  const fs::path other = testing::GeneratedDataset(TownToLocalizeIn(7));
  ExpectRefusal(Localize(other, {"--end", "60"}), {"not one frame was found in the map"});
  EXPECT_EQ(testing::ReadJson(out_ / "summary.json")["frames"]["localized"], 0);
}

TEST_F(LocalizeCommand, AnotherCameraAndAFolderThatHoldsTheMapAreRefused) {
  SyntheticOptions options = TownToLocalizeIn(1);
  options.width = 400;
  const fs::path wider = testing::GeneratedDataset(options);
  ExpectRefusal(Localize(wider, {"--config", wider / "config.yaml"}), {"has another camera than the map"});
  ExpectRefusal(RunTutti({"localize", "--map", map_, "--dataset", town_, "--out", run_}),
                {"choose another --out"});
  EXPECT_TRUE(fs::exists(map_));
}

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
  const std::string run = Done(RunTutti({"map", "prune", map_, "-o", small_}));
  EXPECT_EQ(ReadAll(map_) == before, true);
  const MapInfo large = ReadMapInfo(map_), small = ReadMapInfo(small_);
  EXPECT_LT(small.keyframes, large.keyframes);
  EXPECT_LE(small.landmarks, large.landmarks);
  EXPECT_EQ(small.frames, large.frames);
  EXPECT_EQ(small.note, large.note);
  EXPECT_LT(fs::file_size(small_), fs::file_size(map_));
  EXPECT_THAT(run, HasSubstr(std::to_string(large.keyframes) + " -> "));
  EXPECT_NO_THROW(CheckMapFile(small_));
  ASSERT_EQ(RunTutti({"map", "prune", map_}).status, 0);
  EXPECT_EQ(ReadAll(map_) == ReadAll(small_), true) << "in place it is the same";
  for (const char* action : {"info", "export"}) {
    Done(std::string(action) == "info"
             ? RunTutti({"map", "info", small_, "--check"})
             : RunTutti({"export", small_, "--g2o", folder_ / "graph.g2o", "--tum", folder_ / "poses.txt"}));
  }
}

TEST_F(MapPrune, WhatIsNoFinishedMapIsRefusedByNameAndStays) {
  const fs::path absent = folder_ / "absent.tutti";
  ExpectRefusal(RunTutti({"map", "prune", absent}), {absent});
  const fs::path checkpoint = folder_ / "checkpoint.tutti";
  const MapInfo info = ReadMapInfo(map_);
  LoadMap(map_, info)->Snapshot().Write(checkpoint, [](const MapSink& sink) { sink(300, "a run"); });
  const std::string before = ReadAll(checkpoint);
  ExpectRefusal(RunTutti({"map", "prune", checkpoint}), {checkpoint.string() + ": is a checkpoint"});
  EXPECT_EQ(ReadAll(checkpoint) == before, true);
  ExpectRefusal(RunTutti({"map", "prune", map_, "-o", folder_ / "no" / "where.tutti"}), {"where.tutti"});
}

TEST(MapExample, MapsALapAndLocatesTheNextFramesInIt) {
  constexpr int kLap = 142;
  const std::filesystem::path town = testing::GeneratedDataset(testing::SmallStereoTownWithALoop(320, 160));
  const std::filesystem::path map = testing::FreshFolder() / "map.tutti";
  const std::string run = Done(
      RunProgramAndSignal(TUTTI_EXAMPLE_06, {town / "config.yaml", town, std::to_string(kLap), map}, "", 0));
  EXPECT_THAT(run, HasSubstr("map of 142 frames: "));
  EXPECT_THAT(run, HasSubstr(" landmarks, sigma 0.0"));
  EXPECT_THAT(run, HasSubstr(" frames are in the map\n"));
  EXPECT_EQ(ReadMapInfo(map).frames, kLap) << "the map has none of the frames that were located in it";
}

TEST(MapExample, SaysWhatIsWrong) {
  const std::filesystem::path nothing = testing::FreshFolder() / "nothing";
  EXPECT_THAT(RunProgramAndSignal(TUTTI_EXAMPLE_06, {nothing}, "", 0).output, HasSubstr("usage: "));
  ExpectRefusal(RunProgramAndSignal(TUTTI_EXAMPLE_06, {nothing, nothing, "5", nothing}, "", 0), {nothing});
}

}  // namespace
}  // namespace tutti
