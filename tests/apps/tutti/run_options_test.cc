// What commands are told, and how they answer: options that can't be, words for the shell, notes on stderr.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

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

long LinesWith(const std::string& text, const std::string& with) {
  long count = 0;
  for (std::size_t at = 0; (at = text.find(with, at)) != std::string::npos; ++at) ++count;
  return count;
}

TEST(RunOptions, OnesThatCantBeAreRefusedBeforeTheImagesAreRead) {
  const fs::path folder = testing::FreshFolder();
  testing::WriteAll(folder / "file", "x");
  fs::create_directories(folder / "foreign");
  testing::WriteAll(folder / "foreign/letter.txt", "x");
  // A folder of images alone: its focal length would be measured first.
  const std::string images = (testing::TinyTown() / "image_0").string(), out = (folder / "out").string();
  const std::vector<std::pair<std::vector<std::string>, std::string>> wrong = {
      {{"run", images, "--out", out, "--threads", "-1"}, "--threads: '-1' is not a number above 0"},
      {{"run", images, "--out", out, "--threads", "0"}, "--threads: '0'"},
      {{"run", images, "--out", out, "--view", "--view-port", "80000"}, "--view-port: '80000'"},
      {{"run", images, "--out", out, "--view", "--view-wait", "-3"}, "--view-wait: '-3'"},
      {{"run", images, "--out", (folder / "file").string()}, "file: is a file"},
      {{"run", images, "--out", (folder / "file/out").string()}, "out: the folder can't be made"},
      {{"run", images, "--out", (folder / "foreign").string()}, "holds letter.txt, which is no result"},
      {{"run", images, "--out", out, "--require", "super"}, "--require: 'super' is unknown"},
      {{"run", images, "--out", out, "--ground-truth", (folder / "no.txt").string()},
       "no.txt: can't be opened"},
      {{"run", images, "--out", out, "--trace", (folder / "no/trace.json").string()}, "trace.json"},
      {{"run", images, "--out", out, "--save-map", (folder / "no/map.tutti").string()}, "map.tutti"},
      {{"loops", images, "--out", (folder / "foreign").string()}, "holds letter.txt, which is no result"},
      {{"loops", images, "--out", out, "--threads", "-1"}, "--threads: '-1'"},
      {{"optimize", "in.g2o", "--out", (folder / "no/x.g2o").string()}, "x.g2o: can't be written"},
      {{"convert", "in.txt", (folder / "foreign").string(), "--to", "tum"}, "foreign: can't be written"}};
  for (const auto& [arguments, said] : wrong) {
    const auto run = RunTutti(arguments);
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, AllOf(HasSubstr(said), Not(HasSubstr("measuring"))));
    EXPECT_FALSE(fs::exists(out)) << said;
  }
  const auto run = RunTutti({"run", images, "--out", out, "--start", "500"});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, HasSubstr("has 30 frames, 0 to 29; it can't start with frame 500"));
}

TEST(RunOptions, AnUnknownOptionNamesTheNearest) {
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

TEST(RunOptions, AFailedRunHasExitStatusOneAndNamesTheCommandForPhotos) {
  const fs::path folder = testing::FreshFolder(), photos = Photos(folder / "photos");
  const auto run = RunTutti({"run", photos.string(), "--out", (folder / "out").string(), "--fov", "60"});
  EXPECT_EQ(run.status, 1) << run.output;
  EXPECT_THAT(run.output,
              AllOf(HasSubstr("failed:"), HasSubstr("`tutti loops " + photos.string() + "` finds")));
}

TEST(RunOptions, TheBarOfTheExitStatusCanBeSet) {
  const fs::path folder = testing::FreshFolder(), out = folder / "out";
  const fs::path data = testing::CopyOfTinyTown(folder / "data");
  for (int i = 10; i < 20; ++i)  // a third of the images: doubtful
    testing::WriteAll(data / "image_0" / ("0000" + std::to_string(i) + ".png"), "no image");
  const auto run = [&](const std::vector<std::string>& more) {
    return RunTutti(testing::RunArguments(testing::TinyConfig(folder), data, out, more));
  };
  const auto usual = run({});
  EXPECT_EQ(usual.status, 0) << usual.output;
  EXPECT_THAT(usual.output, HasSubstr("33.3 % of the images are damaged"));
  EXPECT_EQ(LinesWith(usual.output, "is skipped"), 5);
  EXPECT_THAT(usual.output, HasSubstr("tutti: 5 more frames are skipped; frames.bad_frames in summary.json"));
  const auto strict = run({"--require", "good"});
  EXPECT_EQ(strict.status, 1);
  EXPECT_THAT(strict.output, HasSubstr("tutti: the result is doubtful, and --require good asks for more"));
  for (int i = 0; i < 10; ++i)  // two thirds: failed
    testing::WriteAll(data / "image_0" / ("00000" + std::to_string(i) + ".png"), "no image");
  EXPECT_EQ(run({}).status, 1);
  EXPECT_EQ(run({"--require", "failed", "--quiet"}).status, 0);
}

TEST(RunOptions, QuietIsQuietAndLibrariesSayALineFiveTimes) {
  const fs::path folder = testing::FreshFolder(), images = folder / "images";
  fs::create_directories(images);
  for (int i = 0; i < 12; ++i) {  // bytes in the middle of a JPEG are wrong: its library prints a line
    std::vector<unsigned char> bytes;
    cv::imencode(".jpg", cv::imread((testing::TinyTown() / "image_0/000000.png").string()), bytes);
    for (std::size_t k = bytes.size() / 2; k < bytes.size() / 2 + 300; k += 7) bytes[k] ^= 0x55U;
    std::ofstream(images / (std::to_string(i) + ".jpg"), std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  const std::string out = (folder / "out").string();
  const auto loud = RunTutti({"run", images.string(), "--fov", "60", "--out", out});
  EXPECT_EQ(LinesWith(loud.output, "Corrupt JPEG data"), 5 + 1) << loud.output;
  EXPECT_THAT(loud.output, HasSubstr(" more lines of a library like 'Corrupt JPEG data"));
  const auto quiet = RunTutti({"run", images.string(), "--fov", "60", "--out", out, "--quiet"});
  EXPECT_THAT(quiet.output,
              AllOf(Not(HasSubstr("Corrupt")), Not(HasSubstr("layout")), Not(HasSubstr("slam"))));
  const auto wrong = RunTutti({"run", images.string(), "--quiet", "--stride", "-1"});
  EXPECT_THAT(wrong.output, HasSubstr("--stride: '-1'")) << "an error is no note";
}

TEST(RunOptions, RepeatedTimeStampsAreNamedFiveTimesAndCountAgainstTheRun) {
  const fs::path folder = testing::FreshFolder(), data = testing::CopyOfTinyTown(folder / "data");
  std::string times = "0\n";
  for (int i = 1; i < 30; ++i) times += i < 10 ? "0\n" : std::to_string(0.1 * i) + "\n";
  testing::WriteAll(data / "times.txt", times);
  const auto run = RunTutti(testing::RunArguments(testing::TinyConfig(folder), data, folder / "out"));
  EXPECT_EQ(LinesWith(run.output, "repeats the time stamp before it"), 5) << run.output;
  EXPECT_THAT(run.output, HasSubstr("4 more lines repeat the time stamp before them"));
  const auto health = nlohmann::json::parse(ReadAll(folder / "out/summary.json"))["health"];
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

TEST(RunOptions, AScaleThatTheGroundTruthContradictsIsNotGood) {
  const fs::path folder = testing::FreshFolder();
  for (const auto& [factor, word] : {std::pair(5.0, "failed"), {1.2, "doubtful"}}) {
    const fs::path data = testing::CopyOfTinyTown(folder / ("data" + std::to_string(factor)));
    ScaleGroundTruth(data, factor);
    const auto run = RunTutti(testing::RunArguments(testing::TinyConfig(folder), data, folder / "out"));
    EXPECT_THAT(run.output, HasSubstr("the ground truth says that the scale is off by a factor of"));
    const auto summary = nlohmann::json::parse(ReadAll(folder / "out/summary.json"));
    EXPECT_EQ(summary["health"]["word"], word) << run.output;
    EXPECT_NEAR(summary["evaluation"]["sim3_scale"].get<double>(), factor, 0.05 * factor);
    EXPECT_EQ(run.status, word == std::string("failed") ? 1 : 0);
  }
}

}  // namespace
}  // namespace tutti
