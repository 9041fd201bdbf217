// `tutti run`, end to end, through the real executable: what it writes, is told, and answers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

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

class RunCommand : public testing::TownTest {
 protected:
  std::string Poses(const std::string& out, const std::string& name = "trajectory.txt") const {
    return ReadAll(folder_ / out / name);
  }
};

TEST_F(RunCommand, WritesEverythingThatScriptsRelyOn) {
  const std::string run = Done(Run("out"));
  const fs::path& out = out_;
  const Trajectory trajectory = ReadTrajectory(out / "trajectory.txt", TrajectoryFormat::kTum);
  EXPECT_EQ(trajectory.size(), static_cast<std::size_t>(testing::kTinyFrames));
  EXPECT_EQ(ReadAll(out / "trajectory.txt"), ReadAll(out / "trajectory_odometry.txt"));  // no loop in it
  EXPECT_FALSE(ReadTrajectory(out / "keyframes.txt", TrajectoryFormat::kTum).empty());
  EXPECT_THAT(ReadAll(out / "graph.g2o"), HasSubstr("EDGE_SE3:QUAT"));
  EXPECT_THAT(ReadAll(out / "loops.csv"), StartsWith("query,candidate,query_stamp_s,candidate_stamp_s,surf,"
                                                     "sift,orb,ensemble,inliers,matches,accepted,reason"));
  EXPECT_THAT(ReadAll(out / "trajectory.svg"), HasSubstr("reference"));
  EXPECT_GT(fs::file_size(out / "trajectory.png"), 1000u);

  const nlohmann::json s = Summary();
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
  EXPECT_THAT(run, HasSubstr("  good: nothing that the run shows"));
}

TEST_F(RunCommand, SameBytesForOneAndTwoThreadsAndWithoutLoops) {
  Done(Run("one", {"--threads", "1"}));
  Done(Run("two", {"--threads", "2"}));
  Done(Run("odometry", {"--no-loops"}));
  for (const char* name : {"trajectory.txt", "keyframes.txt", "loops.csv", "graph.g2o"})
    EXPECT_EQ(Poses("one", name), Poses("two", name)) << name;
  EXPECT_FALSE(Poses("one").empty());
  EXPECT_EQ(Poses("one", "trajectory_odometry.txt"), Poses("odometry"));
}

TEST_F(RunCommand, MaxFramesAndGroundTruthNone) {
  Done(Run("out", {"--end", "5", "--ground-truth", "none", "--quiet"}));
  const nlohmann::json s = Summary();
  EXPECT_EQ(s["frames"]["total"], 5);
  EXPECT_FALSE(s.contains("evaluation"));
  EXPECT_FALSE(s["loops"].contains("true"));
}

TEST_F(RunCommand, TimingTableAndTraceChangeNoResult) {
  const std::string run = Done(Run("measured", {"--end", "10", "--timing", "--trace", folder_ / "t.json"}));
  Done(Run("plain", {"--end", "10"}));
  EXPECT_EQ(Poses("measured"), Poses("plain"));
  EXPECT_FALSE(Summary("plain")["timing"].contains("stages"));
  EXPECT_THAT(run, HasSubstr("tracking      frame"));
  EXPECT_EQ(Summary("measured")["timing"]["stages"][0]["lane"], "reading");
  const auto trace = testing::ReadJson(folder_ / "t.json");
  int frames = 0;
  for (const auto& event : trace["traceEvents"]) frames += event["name"] == "frame" ? 1 : 0;
  EXPECT_EQ(frames, 10);
}

TEST_F(RunCommand, UncalibratedImagesGiveLoopsOnlyAndSaySo) {
  testing::WriteAll(folder_ / "images.yaml", "dataset: {type: images, sensor: mono}\n");
  EXPECT_THAT(
      Done(RunTutti(testing::RunArguments(folder_ / "images.yaml", testing::TinyTown() / "image_0", out_))),
      HasSubstr("appearance only"));
  EXPECT_FALSE(fs::exists(out_ / "trajectory.txt"));
  EXPECT_TRUE(fs::exists(out_ / "loops.csv"));
  EXPECT_TRUE(Summary()["appearance_only"].get<bool>());
}

TEST_F(RunCommand, ACalibrationThatCanNotBeRightIsSaidAndTheRunGoesOn) {
  const std::vector<std::string> configured = {"calibrate-check", "--config", config_, "--dataset",
                                               testing::TinyTown()};
  // What is found in the recording, where no file is given.
  const std::vector<std::string> found = {"calibrate-check", testing::TinyTown()};
  for (const std::vector<std::string>& words : {configured, found})
    EXPECT_THAT(Done(RunTutti(words)), HasSubstr("nothing speaks against"));
  const fs::path swapped = testing::CopyOfTinyTown(folder_ / "swapped");
  fs::rename(swapped / "image_0", swapped / "image");
  fs::rename(swapped / "image_1", swapped / "image_0");
  fs::rename(swapped / "image", swapped / "image_1");
  ExpectRefusal(RunTutti({"calibrate-check", "--config", config_, "--dataset", swapped}),
                {"left and right are swapped"});
  const std::string output = RunTutti(testing::RunArguments(config_, swapped, out_, {"--end", "3"})).output;
  EXPECT_THAT(output, AllOf(HasSubstr("warning: the calibration can't be right"),
                            HasSubstr("    * the calibration can't be right")));
  EXPECT_EQ(Summary()["calibration_findings"].size(), 1u);
}

TEST_F(RunCommand, AFollowedFolderGivesWhatACompleteOneGives) {
  Done(Run("complete", {"--end", "6", "--no-loops"}));
  Done(Run("followed", {"--end", "6", "--no-loops", "--follow", "0.5"}));
  EXPECT_EQ(Poses("complete"), Poses("followed"));
}

TEST_F(RunCommand, CtrlCWritesWhatThereIsAndSaysSo) {
  const auto run =
      testing::RunTuttiAndSignal(testing::RunArguments(config_, testing::TinyTown(), out_), " 20%", SIGINT);
  EXPECT_EQ(run.status, 130) << run.output;
  EXPECT_THAT(run.output, HasSubstr("interrupted"));
  const nlohmann::json s = Summary();
  EXPECT_TRUE(s["interrupted"].get<bool>());
  EXPECT_LT(s["frames"]["total"].get<int>(), testing::kTinyFrames);
  EXPECT_EQ(ReadTrajectory(out_ / "trajectory.txt", TrajectoryFormat::kTum).size(),
            s["frames"]["tracked"].get<std::size_t>());
}

TEST_F(RunCommand, HelpConfigAndVersion) {
  EXPECT_THAT(RunTutti({"run", "--help-config"}).output, HasSubstr("loop_threshold"));
  EXPECT_THAT(RunTutti({"--version"}).output, StartsWith("tutti "));
}

TEST_F(RunCommand, RedKitchenBeginsWell) {
  TUTTI_REQUIRE_DATA(dataset, "redkitchen");
  Done(RunTutti(testing::RunArguments(testing::SourceDir() / "data" / "configs" / "7scenes.yaml", dataset,
                                      out_, {"--end", "60"})));
  const nlohmann::json s = Summary();
  EXPECT_GE(s["frames"]["tracked"].get<int>(), 59);
  EXPECT_LT(s["evaluation"]["slam"]["ate_rmse_m"].get<double>(), 0.05);
}

long LinesWith(const std::string& text, const std::string& with) {
  long count = 0;
  for (std::size_t at = 0; (at = text.find(with, at)) != std::string::npos; ++at) ++count;
  return count;
}

class RunOptions : public testing::TownTest {};

TEST_F(RunOptions, OnesThatCantBeAreRefusedBeforeTheImagesAreRead) {
  testing::WriteAll(folder_ / "file", "x");
  fs::create_directories(folder_ / "foreign");
  testing::WriteAll(folder_ / "foreign/letter.txt", "x");
  // A folder of images alone: its focal length would be measured first.
  const std::string images = (testing::TinyTown() / "image_0").string(), out = out_.string();
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong = {
      {{"run", images, "--out", out, "--threads", "-1"}, "--threads: '-1' is not a number above 0"},
      {{"run", images, "--out", out, "--threads", "0"}, "--threads: '0'"},
      {{"run", images, "--out", out, "--view", "--view-port", "80000"}, "--view-port: '80000'"},
      {{"run", images, "--out", out, "--view", "--view-wait", "-3"}, "--view-wait: '-3'"},
      {{"run", images, "--out", folder_ / "file"}, "file: is a file"},
      {{"run", images, "--out", folder_ / "file/out"}, "out: the folder can't be made"},
      {{"run", images, "--out", folder_ / "foreign"}, "holds letter.txt, which is no result"},
      {{"run", images, "--out", out, "--require", "super"}, "--require: 'super' is unknown"},
      {{"run", images, "--out", out, "--ground-truth", folder_ / "no.txt"}, "no.txt: can't be opened"},
      {{"run", images, "--out", out, "--trace", folder_ / "no/trace.json"}, "trace.json"},
      {{"run", images, "--out", out, "--save-map", folder_ / "no/map.tutti"}, "map.tutti"},
      {{"loops", images, "--out", folder_ / "foreign"}, "holds letter.txt, which is no result"},
      {{"loops", images, "--out", out, "--threads", "-1"}, "--threads: '-1'"},
      {{"optimize", "in.g2o", "--out", folder_ / "no/x.g2o"}, "x.g2o: can't be written"},
      {{"convert", "in.txt", folder_ / "foreign", "--to", "tum"}, "foreign: can't be written"}};
  for (const auto& [arguments, said] : wrong) {
    const auto run = RunTutti(arguments);
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, AllOf(HasSubstr(said), Not(HasSubstr("measuring"))));
    EXPECT_FALSE(fs::exists(out)) << said;
  }
  ExpectRefusal(RunTutti({"run", images, "--out", out, "--start", "500"}),
                {"has 30 frames, 0 to 29; it can't start with frame 500"});
}

TEST_F(RunOptions, AnUnknownOptionNamesTheNearest) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong = {
      {{"run", "x", "--thread", "2"}, "no option '--thread' of tutti run; the nearest is '--threads'"},
      {{"loops", "x", "--treads=3"}, "no option '--treads' of tutti loops; the nearest is '--threads'"},
      {{"evaluate", "--referense", "x"}, "no option '--referense' of tutti evaluate; the nearest is '--ref"},
      {{"--versoin"}, "no option '--versoin' of tutti; the nearest is '--version'"}};
  for (const auto& [arguments, said] : wrong) {
    const auto run = RunTutti(arguments);
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, AllOf(::testing::StartsWith("tutti: there is "), HasSubstr(said)));
  }
}

// What one shows is not in the next.
fs::path Photos(const fs::path& folder) {
  fs::create_directories(folder);
  for (int i = 0; i < 30; ++i) {
    cv::Mat photo(120, 160, CV_8UC1);
    cv::RNG random(static_cast<std::uint64_t>(i) + 1);
    random.fill(photo, cv::RNG::UNIFORM, 0, 255);
    cv::imwrite((folder / (std::to_string(i) + ".png")).string(), photo);
  }
  return folder;
}

TEST_F(RunOptions, AFailedRunHasExitStatusOneAndNamesTheCommandForPhotos) {
  const fs::path photos = Photos(folder_ / "photos");
  ExpectRefusal(RunTutti({"run", photos, "--out", out_, "--fov", "60"}),
                {"failed:", "`tutti loops " + photos.string() + "` finds"});
}

TEST_F(RunOptions, TheBarOfTheExitStatusCanBeSet) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  for (int i = 10; i < 20; ++i)  // a third of the images: doubtful
    testing::WriteAll(data / "image_0" / ("0000" + std::to_string(i) + ".png"), "no image");
  const auto run = [&](const std::vector<std::string>& more) {
    return RunTutti(testing::RunArguments(config_, data, out_, more));
  };
  const std::string usual = Done(run({}));
  EXPECT_THAT(usual, HasSubstr("33.3 % of the images are damaged"));
  EXPECT_EQ(LinesWith(usual, "is skipped"), 5);
  EXPECT_THAT(usual, HasSubstr("tutti: 5 more frames are skipped; frames.bad_frames in summary.json"));
  ExpectRefusal(run({"--require", "good"}),
                {"tutti: the result is doubtful, and --require good asks for more"});
  for (int i = 0; i < 10; ++i)  // two thirds: failed
    testing::WriteAll(data / "image_0" / ("00000" + std::to_string(i) + ".png"), "no image");
  EXPECT_EQ(run({}).status, 1);
  EXPECT_EQ(run({"--require", "failed", "--quiet"}).status, 0);
}

TEST_F(RunOptions, QuietIsQuietAndLibrariesSayALineFiveTimes) {
  const fs::path images = folder_ / "images";
  fs::create_directories(images);
  for (int i = 0; i < 12; ++i) {  // bytes in the middle of a JPEG are wrong: its library prints a line
    std::vector<unsigned char> bytes;
    cv::imencode(".jpg", cv::imread((testing::TinyTown() / "image_0/000000.png").string()), bytes);
    for (std::size_t k = bytes.size() / 2; k < bytes.size() / 2 + 300; k += 7) bytes[k] ^= 0x55U;
    std::ofstream(images / (std::to_string(i) + ".jpg"), std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  const std::string out = out_.string();
  const auto loud = RunTutti({"run", images, "--fov", "60", "--out", out});
  EXPECT_EQ(LinesWith(loud.output, "Corrupt JPEG data"), 5 + 1) << loud.output;
  EXPECT_THAT(loud.output, HasSubstr(" more lines of a library like 'Corrupt JPEG data"));
  const auto quiet = RunTutti({"run", images, "--fov", "60", "--out", out, "--quiet"});
  EXPECT_THAT(quiet.output,
              AllOf(Not(HasSubstr("Corrupt")), Not(HasSubstr("layout")), Not(HasSubstr("slam"))));
  const auto wrong = RunTutti({"run", images, "--quiet", "--stride", "-1"});
  EXPECT_THAT(wrong.output, HasSubstr("--stride: '-1'")) << "an error is no note";
}

TEST_F(RunOptions, RepeatedTimeStampsAreNamedFiveTimesAndCountAgainstTheRun) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  std::string times = "0\n";
  for (int i = 1; i < 30; ++i) times += i < 10 ? "0\n" : std::to_string(0.1 * i) + "\n";
  testing::WriteAll(data / "times.txt", times);
  const auto run = RunTutti(testing::RunArguments(config_, data, out_));
  EXPECT_EQ(LinesWith(run.output, "repeats the time stamp before it"), 5) << run.output;
  EXPECT_THAT(run.output, HasSubstr("4 more lines repeat the time stamp before them"));
  const auto health = Summary()["health"];
  EXPECT_NE(health["word"], "good");
  EXPECT_NEAR(health["signs"]["damaged_images"].get<double>(), 9.0 / 30, 1e-9);
}

// poses.txt with all positions `factor` times as far.
void ScaleGroundTruth(const fs::path& data, double factor) {
  std::istringstream in(ReadAll(data / "poses.txt"));
  std::ostringstream out;
  double value = 0;
  for (int i = 0; in >> value; ++i)
    out << (i % 4 == 3 ? factor * value : value) << (i % 12 == 11 ? '\n' : ' ');
  testing::WriteAll(data / "poses.txt", out.str());
}

TEST_F(RunOptions, AScaleThatTheGroundTruthContradictsIsNotGood) {
  for (const auto& [factor, word] : {std::pair(5.0, "failed"), {1.2, "doubtful"}}) {
    const fs::path data = testing::CopyOfTinyTown(folder_ / ("data" + std::to_string(factor)));
    ScaleGroundTruth(data, factor);
    const auto run = RunTutti(testing::RunArguments(config_, data, out_));
    EXPECT_THAT(run.output, HasSubstr("the ground truth says that the scale is off by a factor of"));
    const auto summary = Summary();
    EXPECT_EQ(summary["health"]["word"], word) << run.output;
    EXPECT_NEAR(summary["evaluation"]["sim3_scale"].get<double>(), factor, 0.05 * factor);
    EXPECT_EQ(run.status, word == std::string("failed") ? 1 : 0);
  }
}

}  // namespace
}  // namespace tutti
