// `tutti run --map` and `tutti merge`: several recordings in one map file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using testing::ReadAll;
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
    std::vector<std::string> words = {"run", "--dataset", town.string(), "--out", out.string(), "--quiet"};
    words.insert(words.end(), more.begin(), more.end());
    return RunTutti(words);
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
  const auto day = Run(town_, day_, {"--config", Config(town_), "--end", "150", "--no-report"});
  ASSERT_EQ(day.status, 0) << day.output;
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
  const json info = json::parse(RunTutti({"map", "info", (next_ / "map.tutti").string(), "--json"}).output);
  ASSERT_EQ(info["sessions"].size(), 2u);
  EXPECT_EQ(info["sessions"][0]["first_keyframe"], 0);
  EXPECT_EQ(info["sessions"][1]["last_keyframe"], static_cast<int>(info["keyframes"]) - 1);
  EXPECT_EQ(info["submaps"], 1);
  for (const auto& [session, frames] : {std::pair("1", 150u), std::pair("2", 0u)}) {
    const fs::path tum = folder_ / (std::string("of") + session + ".tum");
    const auto written = RunTutti({"export", next_.string(), "--tum", tum.string(), "--session", session});
    ASSERT_EQ(written.status, 0) << written.output;
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
  const auto merged = RunTutti({"merge", day, next, "-o", both});
  ASSERT_EQ(merged.status, 0) << merged.output;
  EXPECT_THAT(merged.output, HasSubstr("2 sessions"));
  const json info = json::parse(RunTutti({"map", "info", both, "--json", "--check"}).output);
  EXPECT_EQ(info["sessions"].size(), 2u);
  EXPECT_EQ(info["submaps"], 1);
  EXPECT_EQ(info["frames"], 230);
  const auto localized = RunTutti({"localize", "--map", both, "--dataset", town_.string(), "--start", "150",
                                   "--end", "180", "--out", (folder_ / "where").string()});
  EXPECT_EQ(localized.status, 0) << localized.output;

  const fs::path other = testing::GeneratedDataset(Town(7));
  const fs::path elsewhere = folder_ / "elsewhere";
  ASSERT_EQ(mapped(other, elsewhere, {"--end", "60"}), 0);
  const std::string none = (folder_ / "none.tutti").string();
  const auto refused = RunTutti({"merge", day, (elsewhere / "map.tutti").string(), "-o", none});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.output, HasSubstr("shows no place of"));
  EXPECT_FALSE(fs::exists(none));
  EXPECT_EQ(RunTutti({"merge", day, next, "-o", day}).status, 1);
  fs::create_symlink(day, folder_ / "link.tutti");
  fs::create_hard_link(day, folder_ / "hard.tutti");
  fs::copy_file(day, folder_ / "copy.tutti");
  for (const fs::path& same : {fs::path(day), day_ / "." / "map.tutti", folder_ / "link.tutti",
                               folder_ / "hard.tutti", folder_ / "copy.tutti"}) {
    const auto itself = RunTutti({"merge", day, same.string(), "-o", none});
    EXPECT_EQ(itself.status, 1);
    EXPECT_THAT(itself.output, HasSubstr("are the same map; give the maps of two recordings"));
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
  const auto without = Run(town_, next_, {"--map", (day_ / "map.tutti").string()});
  EXPECT_EQ(without.status, 1);
  EXPECT_THAT(without.output, HasSubstr("without loop closure"));
  const auto into = Run(town_, day_, {"--map", (day_ / "map.tutti").string(), "--config", Config(town_)});
  EXPECT_EQ(into.status, 1);
  EXPECT_THAT(into.output, HasSubstr("choose another --out"));
}

}  // namespace
}  // namespace tutti
