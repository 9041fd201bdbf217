// `tutti run`, end to end, through the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/text.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;

nlohmann::json Summary(const fs::path& out) { return nlohmann::json::parse(ReadAll(out / "summary.json")); }

std::vector<std::string> Arguments(const fs::path& config, const fs::path& dataset, const fs::path& out) {
  return {"run", "--config", config.string(), "--dataset", dataset.string(), "--out", out.string()};
}

TEST(RunCommand, WritesEverythingThatScriptsRelyOn) {
  const fs::path folder = testing::FreshFolder(), out = folder / "out";
  const auto run = RunTutti(Arguments(testing::TinyConfig(folder), testing::TinyTown(), out));
  ASSERT_EQ(run.status, 0) << run.output;
  const Trajectory trajectory = ReadTrajectory(out / "trajectory.txt", TrajectoryFormat::kTum);
  EXPECT_EQ(trajectory.size(), static_cast<std::size_t>(testing::kTinyFrames));
  EXPECT_EQ(ReadAll(out / "trajectory.txt"), ReadAll(out / "trajectory_odometry.txt"));  // no loop in it
  EXPECT_FALSE(ReadTrajectory(out / "keyframes.txt", TrajectoryFormat::kTum).empty());
  EXPECT_THAT(ReadAll(out / "graph.g2o"), HasSubstr("EDGE_SE3:QUAT"));
  EXPECT_THAT(ReadAll(out / "loops.csv"), StartsWith("query,candidate,query_stamp_s,candidate_stamp_s,surf,"
                                                     "sift,orb,ensemble,inliers,matches,accepted,reason"));
  EXPECT_THAT(ReadAll(out / "trajectory.svg"), HasSubstr("reference"));
  EXPECT_GT(fs::file_size(out / "trajectory.png"), 1000u);

  const nlohmann::json s = Summary(out);
  EXPECT_EQ(s["frames"]["total"], testing::kTinyFrames);
  EXPECT_EQ(s["frames"]["tracked"], testing::kTinyFrames);
  EXPECT_EQ(s["frames"]["bad"], 0);
  EXPECT_GT(s["keyframes"].get<int>(), 1);
  for (const char* key : {"proposed", "accepted", "true", "false"})
    EXPECT_TRUE(s["loops"].contains(key)) << key;
  EXPECT_GT(s["timing"]["wall_s"].get<double>(), 0);
  EXPECT_GT(s["timing"]["frame_ms"]["median"].get<double>(), 0);
  EXPECT_GE(s["timing"]["frame_ms"]["p99"].get<double>(), s["timing"]["frame_ms"]["median"].get<double>());
  EXPECT_GT(s["timing"]["latency_ms"]["median"].get<double>(),
            s["timing"]["frame_ms"]["median"].get<double>())
      << "features take time";
  EXPECT_GT(s["timing"]["stage_ms"].size(), 3u);
  EXPECT_GT(s["memory"]["peak_mb"].get<double>(), 10);
  EXPECT_EQ(s["evaluation"]["alignment"], "se3");
  EXPECT_LT(s["evaluation"]["odometry"]["ate_rmse_m"].get<double>(), 0.3);
  EXPECT_LT(s["evaluation"]["slam"]["ate_rmse_m"].get<double>(), 0.3);
  EXPECT_LE(s["stereo"]["row_error_px"].get<double>(), 0.5);
  EXPECT_GE(s["stereo"]["matches"].get<double>(), 100);
  EXPECT_EQ(s["config"]["dataset"]["sensor"], "stereo");
  EXPECT_TRUE(s["config"]["loops"]["verification"].contains("min_inliers"));
  EXPECT_EQ(s["seed"], 1);
  EXPECT_FALSE(s["version"].get<std::string>().empty());
  EXPECT_EQ(s["health"]["word"], "good") << s["health"];
  EXPECT_THAT(run.output, HasSubstr("  good: nothing that the run shows"));
}

// Of two runs, byte for byte.
void ExpectTheSameResults(const fs::path& one, const fs::path& other) {
  for (const char* name : {"trajectory.txt", "keyframes.txt", "loops.csv", "graph.g2o"}) {
    EXPECT_EQ(ReadAll(one / name), ReadAll(other / name)) << name;
  }
  EXPECT_FALSE(ReadAll(one / "trajectory.txt").empty());
}

TEST(RunCommand, SameBytesForOneAndTwoThreadsAndWithoutLoops) {
  const fs::path folder = testing::FreshFolder(), config = testing::TinyConfig(folder);
  auto one = Arguments(config, testing::TinyTown(), folder / "one");
  one.insert(one.end(), {"--threads", "1"});
  auto two = Arguments(config, testing::TinyTown(), folder / "two");
  two.insert(two.end(), {"--threads", "2"});
  auto odometry = Arguments(config, testing::TinyTown(), folder / "odometry");
  odometry.push_back("--no-loops");
  ASSERT_EQ(RunTutti(one).status, 0);
  ASSERT_EQ(RunTutti(two).status, 0);
  ASSERT_EQ(RunTutti(odometry).status, 0);
  ExpectTheSameResults(folder / "one", folder / "two");
  EXPECT_EQ(ReadAll(folder / "one" / "trajectory_odometry.txt"),
            ReadAll(folder / "odometry" / "trajectory.txt"));
}

TEST(RunCommand, MaxFramesAndGroundTruthNone) {
  const fs::path folder = testing::FreshFolder(), out = folder / "out";
  auto arguments = Arguments(testing::TinyConfig(folder), testing::TinyTown(), out);
  arguments.insert(arguments.end(), {"--end", "5", "--ground-truth", "none", "--quiet"});
  const auto run = RunTutti(arguments);
  ASSERT_EQ(run.status, 0) << run.output;
  const nlohmann::json s = Summary(out);
  EXPECT_EQ(s["frames"]["total"], 5);
  EXPECT_FALSE(s.contains("evaluation"));
  EXPECT_FALSE(s["loops"].contains("true"));
}

TEST(RunCommand, TimingTableAndTraceChangeNoResult) {
  const fs::path folder = testing::FreshFolder(), config = testing::TinyConfig(folder);
  auto measured = Arguments(config, testing::TinyTown(), folder / "measured");
  measured.insert(measured.end(), {"--end", "10", "--timing", "--trace", (folder / "t.json").string()});
  auto plain = Arguments(config, testing::TinyTown(), folder / "plain");
  plain.insert(plain.end(), {"--end", "10"});
  const auto run = RunTutti(measured);
  ASSERT_EQ(run.status, 0) << run.output;
  ASSERT_EQ(RunTutti(plain).status, 0);
  EXPECT_EQ(ReadAll(folder / "measured" / "trajectory.txt"), ReadAll(folder / "plain" / "trajectory.txt"));
  EXPECT_FALSE(Summary(folder / "plain")["timing"].contains("stages"));
  EXPECT_THAT(run.output, HasSubstr("tracking      frame"));
  EXPECT_EQ(Summary(folder / "measured")["timing"]["stages"][0]["lane"], "reading");
  const auto trace = nlohmann::json::parse(ReadAll(folder / "t.json"));
  int frames = 0;
  for (const auto& event : trace["traceEvents"]) frames += event["name"] == "frame" ? 1 : 0;
  EXPECT_EQ(frames, 10);
}

TEST(RunCommand, UncalibratedImagesGiveLoopsOnlyAndSaySo) {
  const fs::path folder = testing::FreshFolder(), out = folder / "out";
  testing::WriteAll(folder / "images.yaml", "dataset: {type: images, sensor: mono}\n");
  const auto run = RunTutti(Arguments(folder / "images.yaml", testing::TinyTown() / "image_0", out));
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("appearance only"));
  EXPECT_FALSE(fs::exists(out / "trajectory.txt"));
  EXPECT_TRUE(fs::exists(out / "loops.csv"));
  EXPECT_TRUE(Summary(out)["appearance_only"].get<bool>());
}

TEST(RunCommand, ACalibrationThatCanNotBeRightIsSaidAndTheRunGoesOn) {
  const fs::path folder = testing::FreshFolder(), config = testing::TinyConfig(folder);
  const auto right =
      RunTutti({"calibrate-check", "--config", config.string(), "--dataset", testing::TinyTown().string()});
  EXPECT_EQ(right.status, 0) << right.output;
  EXPECT_THAT(right.output, HasSubstr("nothing speaks against"));
  // What is found in the recording, where no file is given.
  const auto found = RunTutti({"calibrate-check", testing::TinyTown().string()});
  EXPECT_EQ(found.status, 0) << found.output;
  EXPECT_THAT(found.output, HasSubstr("nothing speaks against"));
  const fs::path swapped = testing::CopyOfTinyTown(folder / "swapped");
  fs::rename(swapped / "image_0", swapped / "image");
  fs::rename(swapped / "image_1", swapped / "image_0");
  fs::rename(swapped / "image", swapped / "image_1");
  const auto wrong =
      RunTutti({"calibrate-check", "--config", config.string(), "--dataset", swapped.string()});
  EXPECT_EQ(wrong.status, 1) << wrong.output;
  EXPECT_THAT(wrong.output, HasSubstr("left and right are swapped"));
  auto arguments = Arguments(config, swapped, folder / "out");
  arguments.insert(arguments.end(), {"--end", "3"});
  const std::string output = RunTutti(arguments).output;
  EXPECT_THAT(output, HasSubstr("warning: the calibration can't be right"));
  EXPECT_THAT(output, HasSubstr("    * the calibration can't be right"));
  EXPECT_EQ(Summary(folder / "out")["calibration_findings"].size(), 1u);
}

TEST(RunCommand, AFollowedFolderGivesWhatACompleteOneGives) {
  const fs::path folder = testing::FreshFolder(), config = testing::TinyConfig(folder);
  auto complete = Arguments(config, testing::TinyTown(), folder / "complete");
  complete.insert(complete.end(), {"--end", "6", "--no-loops"});
  auto followed = Arguments(config, testing::TinyTown(), folder / "followed");
  followed.insert(followed.end(), {"--end", "6", "--no-loops", "--follow", "0.5"});
  ASSERT_EQ(RunTutti(complete).status, 0);
  const auto run = RunTutti(followed);
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_EQ(ReadAll(folder / "complete" / "trajectory.txt"), ReadAll(folder / "followed" / "trajectory.txt"));
}

TEST(RunCommand, CtrlCWritesWhatThereIsAndSaysSo) {
  const fs::path folder = testing::FreshFolder(), out = folder / "out";
  const auto run = testing::RunTuttiAndSignal(
      Arguments(testing::TinyConfig(folder), testing::TinyTown(), out), " 20%", SIGINT);
  EXPECT_EQ(run.status, 130) << run.output;
  EXPECT_THAT(run.output, HasSubstr("interrupted"));
  const nlohmann::json s = Summary(out);
  EXPECT_TRUE(s["interrupted"].get<bool>());
  EXPECT_LT(s["frames"]["total"].get<int>(), testing::kTinyFrames);
  EXPECT_EQ(ReadTrajectory(out / "trajectory.txt", TrajectoryFormat::kTum).size(),
            s["frames"]["tracked"].get<std::size_t>());
}

TEST(RunCommand, HelpConfigAndVersion) {
  EXPECT_THAT(RunTutti({"run", "--help-config"}).output, HasSubstr("loop_threshold"));
  EXPECT_THAT(RunTutti({"--version"}).output, StartsWith("tutti "));
}

TEST(RunCommand, RedKitchenBeginsWell) {
  TUTTI_REQUIRE_DATA(dataset, "redkitchen");
  const fs::path folder = testing::FreshFolder(), out = folder / "out";
  auto arguments = Arguments(testing::SourceDir() / "data" / "configs" / "7scenes.yaml", dataset, out);
  arguments.insert(arguments.end(), {"--end", "60"});
  const auto run = RunTutti(arguments);
  ASSERT_EQ(run.status, 0) << run.output;
  const nlohmann::json s = Summary(out);
  EXPECT_GE(s["frames"]["tracked"].get<int>(), 59);
  EXPECT_LT(s["evaluation"]["slam"]["ate_rmse_m"].get<double>(), 0.05);
}

}  // namespace
}  // namespace tutti
