// `tutti compare` and `tutti collect`, end to end, through the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;
using testing::WriteAll;

class CollectCommand : public ::testing::Test {
 protected:
  // A summary with the figures that matter.
  void Summary(const std::string& rule, int seed, double ate, const std::string& evidence = "counts") const {
    nlohmann::json json;
    json["dataset"] = "town";
    json["seed"] = seed;
    json["frames"] = {{"total", 10}};
    json["loops"] = {{"proposed", 4}, {"accepted", 3}, {"false", 1}};
    json["evaluation"]["slam"] = {{"ate_rmse_m", ate}, {"rpe_rmse_m", 0.01}};
    json["timing"] = {{"wall_s", 2.5},
                      {"frame_ms", {{"median", 20}}},
                      {"stage_ms", {{"odometry_track", 1000}, {"loop_verify", 500}, {"loop_wait", 9000}}}};
    json["memory"]["peak_mb"] = 100;
    json["config"]["run"]["loops"] = rule != "odometry";
    json["config"]["loops"]["rule"] = rule == "odometry" ? "joint" : rule;
    if (!evidence.empty()) json["config"]["loops"]["evidence"]["kind"] = evidence;
    const fs::path folder = folder_ / "runs" / (rule + evidence + std::to_string(seed));
    fs::create_directories(folder);
    WriteAll(folder / "summary.json", json.dump());
  }
  testing::ProcessResult Collect(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"collect", (folder_ / "runs").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunTutti(arguments);
  }
  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(CollectCommand, MeansIntervalsAndThePairedTestOverSeeds) {
  for (int seed = 1; seed <= 3; ++seed) {
    Summary("odometry", seed, seed);                         // 1, 2, 3
    Summary("joint", seed, 0.5 * seed - 0.1 * (seed == 2));  // 0.5, 0.9, 1.5
  }
  const fs::path file = folder_ / "c.json";
  const auto run = Collect({"--json", file.string()});
  ASSERT_EQ(run.status, 0) << run.output;
  const auto json = nlohmann::json::parse(ReadAll(file));
  const auto variants = json["datasets"][0]["variants"];
  ASSERT_EQ(variants.size(), 2u);
  const auto& odometry = variants[variants[0]["variant"] == "odometry" ? 0 : 1];
  EXPECT_EQ(odometry["ate_rmse_m"]["count"], 3);
  EXPECT_NEAR(odometry["ate_rmse_m"]["mean"].get<double>(), 2, 1e-12);
  EXPECT_NEAR(odometry["ate_rmse_m"]["half_width_95"].get<double>(), 4.302653 / std::sqrt(3.0), 1e-5);
  EXPECT_NEAR(odometry["odometry_s"]["mean"].get<double>(), 1.0, 1e-12);
  EXPECT_NEAR(odometry["loops_s"]["mean"].get<double>(), 0.5, 1e-12);  // waiting is no work
  EXPECT_EQ(odometry["ate_minus_ensemble"]["pairs"], 3);
  EXPECT_NEAR(odometry["ate_minus_ensemble"]["mean_m"].get<double>(), 3.1 / 3, 1e-12);
  EXPECT_THAT(run.output,
              AllOf(HasSubstr("2.0000 +- 2.4841"),
                    HasSubstr("* Lower than that of odometry (2.0000 m), but the test can't tell")));
}

TEST_F(CollectCommand, TimePerStageIsATableOfItsOwnInEveryFormat) {
  for (int seed = 1; seed <= 2; ++seed) {
    Summary("joint", seed, 0.5);
    Summary("orb", seed, 0.6);
  }
  const fs::path file = folder_ / "c.json";
  const auto text = Collect({"--json", file.string()});
  ASSERT_EQ(text.status, 0) << text.output;
  const std::string stages = text.output.substr(text.output.find("Time per stage:"));
  EXPECT_THAT(stages, ::testing::ContainsRegex("stage \\[s\\] +ensemble +orb"));
  EXPECT_THAT(stages, ::testing::ContainsRegex("odometry_track +1.00 \\+- 0.00 +1.00 \\+- 0.00"));
  // In the order of the work; waiting comes last.
  EXPECT_LT(stages.find("odometry_track"), stages.find("loop_verify"));
  EXPECT_LT(stages.find("loop_verify"), stages.find("loop_wait"));
  EXPECT_THAT(text.output.substr(0, text.output.find("Time per stage:")), Not(HasSubstr("loop_verify")));
  EXPECT_THAT(Collect({"--table-format", "markdown"}).output, HasSubstr("| stage [s]"));
  EXPECT_THAT(Collect({"--table-format", "latex"}).output, HasSubstr("odometry\\_track & 1.00 $\\pm$ 0.00"));
  const auto variant = nlohmann::json::parse(ReadAll(file))["datasets"][0]["variants"][0];
  EXPECT_NEAR(variant["stages_s"]["loop_verify"]["mean"].get<double>(), 0.5, 1e-12);
}

TEST_F(CollectCommand, WaitingAndWorkOnTheCallersThreadAreNotCountedTwice) {
  Summary("joint", 1, 0.5);
  const fs::path summary = folder_ / "runs" / "jointcounts1" / "summary.json";
  auto json = nlohmann::json::parse(ReadAll(summary));
  json["timing"]["stage_ms"]["loop_inline"] = 500;  // one thread: what all loop_ stages took
  WriteAll(summary, json.dump());
  const fs::path file = folder_ / "c.json";
  ASSERT_EQ(Collect({"--json", file.string()}).status, 0);
  const auto variant = nlohmann::json::parse(ReadAll(file))["datasets"][0]["variants"][0];
  EXPECT_NEAR(variant["loops_s"]["mean"].get<double>(), 0.5, 1e-12);
}

TEST_F(CollectCommand, SaysWhereTheEnsembleDidNotHelp) {
  for (int seed = 1; seed <= 2; ++seed) {
    Summary("joint", seed, 0.5);
    Summary("orb", seed, 0.4);
    Summary("naive", seed, 0.6);
  }
  const auto run = Collect();
  EXPECT_THAT(run.output, AllOf(HasSubstr("* Lower than that of naive (0.6000 m), p < 0.05."),
                                HasSubstr("* The ensemble did not help against orb (0.4000 m).")));
}

TEST_F(CollectCommand, TheMeanOfStandardisedEvidenceIsAVariantOfItsOwn) {
  Summary("joint", 1, 0.5);
  Summary("mean", 1, 0.6);
  Summary("mean", 2, 0.7, "standardised");
  Summary("mean", 3, 0.8, "");  // before there was a choice
  const fs::path file = folder_ / "c.json";
  ASSERT_EQ(Collect({"--json", file.string()}).status, 0);
  std::map<std::string, std::size_t> runs;
  const auto json = nlohmann::json::parse(ReadAll(file));
  for (const auto& variant : json["datasets"][0]["variants"])
    runs[variant["variant"]] = variant["seeds"].size();
  EXPECT_EQ(runs, (std::map<std::string, std::size_t>{{"ensemble", 1}, {"mean", 1}, {"seed", 2}}));
}

TEST_F(CollectCommand, OneSeedHasNoIntervalAndNoTest) {
  Summary("joint", 1, 0.5);
  Summary("orb", 1, 0.6);
  const auto run = Collect({"--table-format", "markdown"});
  EXPECT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, AllOf(HasSubstr("| orb"), HasSubstr(" 0.6000 |"), Not(HasSubstr("nan"))));
}

TEST_F(CollectCommand, WhatIsNoRunIsRefused) {
  fs::create_directories(folder_ / "runs");
  EXPECT_THAT(Collect().output, AllOf(StartsWith("tutti: "), HasSubstr("holds no summary.json")));
  for (const char* text : {"", "[1, 2", "{}", "{\"frames\": 1}"}) {
    WriteAll(folder_ / "runs" / "summary.json", text);
    const auto run = Collect();
    EXPECT_EQ(run.status, 1);
    EXPECT_THAT(run.output, AllOf(StartsWith("tutti: "), HasSubstr("is no summary.json")));
  }
}

TEST(CompareCommand, RunsEveryVariantWithEverySeedAndWritesTheTable) {
  const fs::path folder = testing::FreshFolder(), out = folder / "out";
  const auto run = RunTutti({"compare", "--config", testing::TinyConfig(folder).string(), "--dataset",
                             testing::TinyTown().string(), "--out", out.string(), "--variants",
                             "odometry,orb,ensemble", "--seeds", "2", "--max-frames", "12"});
  ASSERT_EQ(run.status, 0) << run.output;
  const auto json = nlohmann::json::parse(ReadAll(out / "comparison.json"));
  const auto variants = json["datasets"][0]["variants"];
  ASSERT_EQ(variants.size(), 3u);
  for (const auto& variant : variants) {
    EXPECT_EQ(variant["seeds"].size(), 2u);
    EXPECT_GT(variant["ate_rmse_m"]["mean"].get<double>(), 0);
    EXPECT_GT(variant["peak_memory_mb"]["mean"].get<double>(), 10);
    EXPECT_EQ(variant["failures"].size(), 0u);
    for (const char* stage : {"read", "odometry_extract", "odometry_track", "odometry_map"})
      EXPECT_GT(variant["stages_s"][stage]["mean"].get<double>(), 0) << stage;
    EXPECT_EQ(variant["stages_s"].contains("loop_extract"), variant["variant"] != "odometry");
  }
  // Only the loop closure differs, and there is no loop in it.
  const std::string trajectory = ReadAll(out / "odometry" / "seed_2" / "trajectory.txt");
  EXPECT_FALSE(trajectory.empty());
  for (const char* variant : {"orb", "ensemble"})
    EXPECT_EQ(ReadAll(out / variant / "seed_2" / "trajectory.txt"), trajectory) << variant;
  EXPECT_THAT(ReadAll(out / "comparison.md"), HasSubstr("| ensemble"));
  // The table again from the folders.
  const auto collected = RunTutti({"collect", out.string()});
  EXPECT_EQ(collected.status, 0) << collected.output;
  EXPECT_THAT(collected.output, HasSubstr("ensemble"));
}

TEST(CompareCommand, BadInputIsRefusedBeforeTheFirstRun) {
  const fs::path folder = testing::FreshFolder();
  const std::string config = testing::TinyConfig(folder).string(), out = (folder / "out").string();
  const auto compare = [&](const fs::path& dataset, const std::string& variants) {
    return RunTutti(
        {"compare", "--config", config, "--dataset", dataset.string(), "--out", out, "--variants", variants});
  };
  const auto unknown = compare(testing::TinyTown(), "odometry,bag");
  EXPECT_EQ(unknown.status, 1);
  EXPECT_THAT(unknown.output, AllOf(StartsWith("tutti: --variants: 'bag'"), HasSubstr("Known")));
  EXPECT_THAT(compare(testing::TinyTown(), "orb,orb").output, HasSubstr("named twice"));
  EXPECT_THAT(compare(folder / "nowhere", "orb").output, AllOf(StartsWith("tutti: "), HasSubstr("nowhere")));
  // Less than nothing is no large number.
  for (const char* option : {"--seeds", "--max-frames"}) {
    const auto below = RunTutti({"compare", "--config", config, "--dataset", testing::TinyTown().string(),
                                 "--out", out, "--variants", "orb", option, "-1"});
    EXPECT_EQ(below.status, 1);
    EXPECT_THAT(below.output, AllOf(HasSubstr(option), HasSubstr("'-1'")));
  }
  EXPECT_FALSE(fs::exists(out));
}

TEST(CompareCommand, ARunThatFailsIsReportedAndTheTableStillWritten) {
  const fs::path folder = testing::FreshFolder();
  const auto run =
      RunTutti({"compare", "--config", testing::TinyConfig(folder).string(), "--dataset",
                testing::TinyTown().string(), "--out", (folder / "out").string(), "--variants",
                "odometry,orb", "--seeds", "1", "--ground-truth", (folder / "none.txt").string()});
  EXPECT_EQ(run.status, 1) << run.output;
  EXPECT_THAT(run.output, AllOf(HasSubstr("none.txt"), HasSubstr("0 (1 failed)")));
  const auto json = nlohmann::json::parse(ReadAll(folder / "out" / "comparison.json"));
  EXPECT_EQ(json["datasets"][0]["variants"][1]["failures"].size(), 1u);
}

}  // namespace
}  // namespace tutti
