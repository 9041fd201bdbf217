// `tutti compare` and `tutti collect`, end to end, through the real executable.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/report/page.h"
#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/in_folder.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;
using testing::WriteAll;

class CollectCommand : public ::testing::Test {
 protected:
  // A summary with the figures that matter.
  void Summary(const std::string& rule, int start, double ate, const std::string& evidence = "counts") const {
    nlohmann::json json;
    json["dataset"] = "town";
    json["seed"] = 1;
    json["config"]["dataset"]["start"] = start;
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
    const fs::path folder = folder_ / "runs" / (rule + evidence + std::to_string(start));
    fs::create_directories(folder);
    WriteAll(folder / "summary.json", json.dump());
  }
  testing::ProcessResult Collect(const std::vector<std::string>& more = {}) const {
    return RunTutti({"collect", folder_ / "runs"}, more);
  }
  const fs::path folder_ = testing::FreshFolder(), file_ = folder_ / "c.json";
};

// A report of a stranger, or of a disk that was full.
TEST_F(CollectCommand, ADamagedReportIsNamedAndTheTablesAreThere) {
  if (!ReportsAvailable()) GTEST_SKIP() << "built without the chart library";
  Summary("joint", 1, 0.5);
  const fs::path report = folder_ / "runs" / "jointcounts1" / "report.json", page = folder_ / "page.html";
  WriteAll(report, "{\"format\": 2, \"dataset\": [], \"variant\": 7}");
  EXPECT_THAT(Done(Collect({"--report", page})),
              AllOf(HasSubstr(report.string() + ": is damaged"), HasSubstr("Means over the runs")));
  EXPECT_THAT(ReadAll(page), HasSubstr("no charts"));
}

TEST_F(CollectCommand, NamesOfOthersDoNothingToTheTerminal) {
  Summary("joint\x1b[2J", 1, 0.5);
  EXPECT_THAT(Done(Collect()), AllOf(HasSubstr("joint\\x1b[2J"), ::testing::Not(HasSubstr("\x1b"))));
  const auto absent = RunTutti({"convert", folder_ / "no\x1b]0;x\a", "out.txt", "--to", "tum"});
  EXPECT_EQ(absent.status, 1);
  EXPECT_THAT(absent.output, AllOf(HasSubstr("no\\x1b]0;x\\x07"), ::testing::Not(HasSubstr("\x1b"))));
}

TEST_F(CollectCommand, MeansIntervalsAndThePairedTestOverFirstFrames) {
  for (int start = 1; start <= 5; ++start) {
    Summary("odometry", start, start);                          // 1, 2, 3, 4, 5
    Summary("joint", start, 0.5 * start - 0.1 * (start == 2));  // 0.5, 0.9, 1.5, 2, 2.5
  }
  const std::string run = Done(Collect({"--json", file_}));
  const auto json = testing::ReadJson(file_);
  const auto variants = json["datasets"][0]["variants"];
  ASSERT_EQ(variants.size(), 2u);
  const auto& odometry = variants[variants[0]["variant"] == "odometry" ? 0 : 1];
  EXPECT_EQ(odometry["ate_rmse_m"]["count"], 5);
  EXPECT_NEAR(odometry["ate_rmse_m"]["mean"].get<double>(), 3, 1e-12);
  EXPECT_NEAR(odometry["ate_rmse_m"]["half_width_95"].get<double>(), 2.776445 * std::sqrt(2.5 / 5), 1e-5);
  EXPECT_DOUBLE_EQ(odometry["ate_rmse_m"]["largest"].get<double>(), 5);
  EXPECT_NEAR(odometry["odometry_s"]["mean"].get<double>(), 1.0, 1e-12);
  EXPECT_NEAR(odometry["loops_s"]["mean"].get<double>(), 0.5, 1e-12);  // waiting is no work
  EXPECT_EQ(odometry["ate_minus_ensemble"]["pairs"], 5);
  EXPECT_NEAR(odometry["ate_minus_ensemble"]["mean_m"].get<double>(), 7.6 / 5, 1e-12);
  EXPECT_LT(odometry["ate_minus_ensemble"]["p"].get<double>(), 0.05);
  EXPECT_THAT(run, AllOf(HasSubstr("3.0000 +- 1.9632"),
                         HasSubstr("What varies between the runs of a variant: the first frame (1 to 5)."),
                         HasSubstr("* Lower than that of odometry (3.0000 m), p < 0.05.")));
}

TEST_F(CollectCommand, ColumnsPrecisionAndTheBestInBoldAreChosen) {
  for (int start = 0; start < 2; ++start) {
    Summary("joint", start, 0.5 + 0.1 * start);
    Summary("orb", start, 0.61 + 0.1 * start);
  }
  const std::vector<std::string> choice = {"--columns", "ate,worst-ate,time", "--precision", "2",
                                           "--bold-best"};
  const auto with = [&](const std::string& format) {
    std::vector<std::string> arguments = choice;
    arguments.insert(arguments.end(), {"--table-format", format});
    return Collect(arguments).output;
  };
  const std::string markdown = with("markdown");
  EXPECT_THAT(
      markdown.substr(0, markdown.find("What varies")),
      AllOf(HasSubstr("| **0.55 +- 0.64** |      **0.60** | 2.5 +- 0.0 |"), HasSubstr(" 0.66 +- 0.64 |"),
            Not(HasSubstr("RPE")), Not(HasSubstr("**2.5"))));  // all times are the same
  EXPECT_THAT(with("latex"), HasSubstr("\\textbf{0.55 $\\pm$ 0.64}"));
  EXPECT_THAT(with("text"), HasSubstr("*0.55 +- 0.64"));
  ExpectRefusal(Collect({"--columns", "ate,rpf"}), {"'rpe'"});
  EXPECT_EQ(Collect({"--precision", "13"}).status, 1);
}

TEST_F(CollectCommand, CsvIsOneTableForOtherPrograms) {
  for (int start = 0; start < 2; ++start) {
    Summary("joint", start, 0.5 + 0.1 * start);
    Summary("orb", start, 0.61 + 0.1 * start);
  }
  const auto run = Collect({"--columns", "runs,ate,p", "--precision", "3", "--table-format", "csv"});
  EXPECT_EQ(run.output,
            "data set,variant,runs,ATE [m],ATE [m] +-,p\n"
            "town,ensemble,2,0.550,0.635,\n"
            "town,orb,2,0.660,0.635,\n");
}

TEST_F(CollectCommand, FewerThanFivePairsHaveNoP) {
  for (int start = 1; start <= 4; ++start) {
    Summary("odometry", start, 1 + 0.01 * start);
    Summary("joint", start, 0.5);
  }
  const std::string run = Done(Collect({"--json", file_}));
  const auto variants = testing::ReadJson(file_)["datasets"][0]["variants"];
  for (const auto& variant : variants) EXPECT_FALSE(variant["ate_minus_ensemble"].contains("p"));
  EXPECT_THAT(run, AllOf(HasSubstr("but these runs can't tell them apart (p >= 0.05, or fewer than 5 pairs)"),
                         Not(HasSubstr("p < 0.05"))));
}

TEST_F(CollectCommand, TimePerStageIsATableOfItsOwnInEveryFormat) {
  for (int start = 0; start < 2; ++start) {
    Summary("joint", start, 0.5);
    Summary("orb", start, 0.6);
  }
  const std::string text = Done(Collect({"--json", file_}));
  const std::string stages = text.substr(text.find("Time per stage:"));
  EXPECT_THAT(stages, ::testing::ContainsRegex("stage \\[s\\] +ensemble +orb"));
  EXPECT_THAT(stages, ::testing::ContainsRegex("odometry_track +1.00 \\+- 0.00 +1.00 \\+- 0.00"));
  // In the order of the work; waiting comes last.
  EXPECT_LT(stages.find("odometry_track"), stages.find("loop_verify"));
  EXPECT_LT(stages.find("loop_verify"), stages.find("loop_wait"));
  EXPECT_THAT(text.substr(0, text.find("Time per stage:")), Not(HasSubstr("loop_verify")));
  EXPECT_THAT(Collect({"--table-format", "markdown"}).output, HasSubstr("| stage [s]"));
  EXPECT_THAT(Collect({"--table-format", "latex"}).output, HasSubstr("odometry\\_track & 1.00 $\\pm$ 0.00"));
  const auto variant = testing::ReadJson(file_)["datasets"][0]["variants"][0];
  EXPECT_NEAR(variant["stages_s"]["loop_verify"]["mean"].get<double>(), 0.5, 1e-12);
}

TEST_F(CollectCommand, WaitingAndWorkOnTheCallersThreadAreNotCountedTwice) {
  Summary("joint", 1, 0.5);
  const fs::path summary = folder_ / "runs" / "jointcounts1" / "summary.json";
  auto json = testing::ReadJson(summary);
  json["timing"]["stage_ms"]["loop_inline"] = 500;  // one thread: what all loop_ stages took
  WriteAll(summary, json.dump());
  Done(Collect({"--json", file_}));
  const auto variant = testing::ReadJson(file_)["datasets"][0]["variants"][0];
  EXPECT_NEAR(variant["loops_s"]["mean"].get<double>(), 0.5, 1e-12);
}

TEST_F(CollectCommand, SaysWhereTheEnsembleDidNotHelp) {
  for (int start = 0; start < 5; ++start) {
    Summary("joint", start, 0.5);
    Summary("orb", start, 0.4);
    Summary("naive", start, 0.6);
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
  Done(Collect({"--json", file_}));
  std::map<std::string, std::size_t> runs;
  const auto json = testing::ReadJson(file_);
  for (const auto& variant : json["datasets"][0]["variants"])
    runs[variant["variant"]] = variant["samples"].size();
  EXPECT_EQ(runs,
            (std::map<std::string, std::size_t>{{"ensemble", 1}, {"mean", 1}, {"standardised-mean", 2}}));
}

TEST_F(CollectCommand, OneRunHasNoIntervalAndNoTest) {
  Summary("joint", 1, 0.5);
  Summary("orb", 1, 0.6);
  EXPECT_THAT(Done(Collect({"--table-format", "markdown"})),
              AllOf(HasSubstr("| orb"), HasSubstr(" 0.6000 |"), Not(HasSubstr("nan"))));
}

TEST_F(CollectCommand, ARunWhoseDataSetHasNoNameIsInTheTable) {
  Summary("orb", 0, 0.5);
  const fs::path file = folder_ / "runs" / "orbcounts0" / "summary.json";
  for (const char* name : {"null", "[]", "{}"}) {
    nlohmann::json json = testing::ReadJson(file);
    json["dataset"] = nlohmann::json::parse(name);
    WriteAll(file, json.dump());
    EXPECT_THAT(Done(Collect()), HasSubstr("0.5000"));
  }
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

class CompareCommand : public testing::TownTest {
 protected:
  // `tutti compare` on these data sets.
  testing::ProcessResult Compare(const std::vector<std::string>& datasets, const std::string& variants,
                                 const std::vector<std::string>& more) const {
    std::vector<std::string> words = {"compare", "--config",   config_,  "--out",
                                      out_,      "--variants", variants, "--dataset"};
    words.insert(words.end(), datasets.begin(), datasets.end());
    words.insert(words.end(), more.begin(), more.end());
    return RunTutti(words);
  }
  nlohmann::json Comparison() const { return testing::ReadJson(out_ / "comparison.json"); }
  const std::string town_ = testing::TinyTown();
};

TEST_F(CompareCommand, RunsEveryVariantFromEveryFirstFrameAndWritesTheTable) {
  const fs::path& out = out_;
  Done(Compare({town_}, "odometry,orb,ensemble", {"--runs", "2", "--noise", "1", "--end", "12"}));
  const auto json = Comparison();
  const auto variants = json["datasets"][0]["variants"];
  ASSERT_EQ(variants.size(), 3u);
  EXPECT_EQ(json["datasets"][0]["varies"],
            "the first frame (0 to 1); image noise, drawn anew (standard deviation 1.0 of 255)");
  for (const auto& variant : variants) {
    EXPECT_EQ(variant["samples"].size(), 2u);
    EXPECT_GT(variant["ate_rmse_m"]["mean"].get<double>(), 0);
    EXPECT_GT(variant["peak_memory_mb"]["mean"].get<double>(), 10);
    EXPECT_EQ(variant["failures"].size(), 0u);
    for (const char* stage : {"read", "odometry_extract", "odometry_track", "odometry_map"})
      EXPECT_GT(variant["stages_s"][stage]["mean"].get<double>(), 0) << stage;
    EXPECT_EQ(variant["stages_s"].contains("loop_extract"), variant["variant"] != "odometry");
  }
  // Only the loop closure differs, and there is no loop in it.
  const std::string trajectory = ReadAll(out / "odometry" / "run_2" / "trajectory.txt");
  EXPECT_FALSE(trajectory.empty());
  for (const char* variant : {"orb", "ensemble"})
    EXPECT_EQ(ReadAll(out / variant / "run_2" / "trajectory.txt"), trajectory) << variant;
  EXPECT_THAT(ReadAll(out / "comparison.md"), HasSubstr("| ensemble"));
  // The table again from the folders.
  EXPECT_THAT(Done(RunTutti({"collect", out})), HasSubstr("ensemble"));
}

// The map is adjusted in the end, for which CHOLMOD would start threads. The thread sanitizer ends a copy of
// a process that had some; without it, all that can be seen is that no copy waits for them.
TEST_F(CompareCommand, VariantsAreCopiesOfAProcessWithoutOtherThreads) {
  SyntheticOptions options = testing::SmallStereoTown(320, 160);
  options.frames = 40;
  const fs::path town = testing::GeneratedDataset(options);
  Done(RunTutti({"compare", "--config", town / "config.yaml", "--dataset", town, "--out", out_, "--variants",
                 "odometry,orb", "--runs", "1"}));
  const auto json = Comparison();
  for (const auto& variant : json["datasets"][0]["variants"]) EXPECT_EQ(variant["failures"].size(), 0u);
}

TEST_F(CompareCommand, SeveralDataSetsMakeOneTable) {
  const fs::path other = folder_ / "other";
  fs::create_directory_symlink(fs::absolute(town_), other);
  const std::string run = Done(Compare({town_, other}, "odometry,orb", {"--runs", "1", "--end", "8"}));
  const auto json = Comparison();
  ASSERT_EQ(json["datasets"].size(), 1u);
  EXPECT_EQ(json["datasets"][0]["varies"], "the data set (2)");
  EXPECT_EQ(json["datasets"][0]["variants"][1]["samples"].size(), 2u);
  EXPECT_THAT(run, HasSubstr(" and 1 more"));
}

TEST_F(CompareCommand, ARecordingThatSaysWhatItIsNeedsNoOption) {
  const testing::InFolder here(folder_);
  const fs::path town = fs::absolute(testing::CopyOfTinyTown("town"));
  EXPECT_THAT(Done(RunTutti({"compare", town, "--variants", "odometry,orb", "--runs", "1", "--end", "8"})),
              HasSubstr("  camera "));
  EXPECT_TRUE(fs::exists("tutti-out/town-compared/comparison.json"));
  // Images alone do not say what the camera is.
  ExpectRefusal(RunTutti({"compare", town / "image_0", "--out", "out"}),
                {"nothing here says what the camera is", "--calibration"});
  EXPECT_FALSE(fs::exists("out"));
}

TEST_F(CompareCommand, BadInputIsRefusedBeforeTheFirstRun) {
  ExpectRefusal(Compare({town_}, "odometry,bag", {}), {"tutti: --variants: 'bag'", "Known"});
  ExpectRefusal(Compare({town_}, "orb,orb", {}), {"named twice"});
  ExpectRefusal(Compare({folder_ / "nowhere"}, "orb", {}), {"tutti: ", "nowhere"});
  // Less than nothing is no large number.
  for (const char* option : {"--runs", "--end", "--start", "--noise"})
    ExpectRefusal(Compare({town_}, "orb", {option, "-1"}), {option, "'-1'"});
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(CompareCommand, ARunThatFailsIsReportedAndTheTableStillWritten) {
  ExpectRefusal(Compare({town_}, "odometry,orb", {"--runs", "1", "--ground-truth", folder_ / "none.txt"}),
                {"none.txt", "0 (1 failed)"});
  EXPECT_EQ(Comparison()["datasets"][0]["variants"][1]["failures"].size(), 1u);
}

}  // namespace
}  // namespace tutti
