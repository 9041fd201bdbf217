// What `tutti run` does with input that is damaged: one clear line, never a crash.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;

class BadInput : public testing::TownTest {
 protected:
  testing::ProcessResult Run(const fs::path& config, const fs::path& dataset,
                             const std::vector<std::string>& more = {}) {
    return RunTutti(testing::RunArguments(config, dataset, out_, more));
  }
  // Refused before any work: status 1 and one line.
  static void ExpectRefused(const testing::ProcessResult& run, const std::string& what) {
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, AllOf(StartsWith("tutti: "), HasSubstr(what)));
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
  }
};

TEST_F(BadInput, AFolderThatIsMissingOrEmpty) {
  fs::create_directories(folder_ / "empty");
  for (const char* name : {"nowhere", "empty"})
    ExpectRefused(Run(config_, folder_ / name), (folder_ / name).string());
}

TEST_F(BadInput, MissingCalibration) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  fs::remove(data / "calib.txt");
  ExpectRefused(Run(config_, data), "calib");
}

TEST_F(BadInput, MissingConfiguration) {
  ExpectRefused(Run(folder_ / "no.yaml", testing::TinyTown()), "no.yaml");
}

TEST_F(BadInput, LessThanNothingIsNoLargeNumber) {
  for (const char* option : {"--seed", "--end"}) {
    ExpectRefusal(Run(config_, testing::TinyTown(), {option, "-1"}), {option, "'-1'"});
  }
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(BadInput, UnknownKeyNamesTheNearestValidOne) {
  const auto run = Run(testing::TinyConfig(folder_, "run:\n  thread: 2\n"), testing::TinyTown());
  ExpectRefused(run, "'threads'");
  EXPECT_THAT(run.output, HasSubstr("tiny.yaml:3:"));
}

TEST_F(BadInput, MissingOptionSaysWhich) {
  ExpectRefused(RunTutti({"run", "--out", "y"}), "tutti run DATASET");
}

TEST_F(BadInput, OutputFolderThatCantBeWritten) {
  testing::WriteAll(folder_ / "file", "x");
  const fs::path config = config_;
  for (const fs::path& out : {folder_ / "file", folder_ / "file" / "out", fs::path("/proc/tutti-out")}) {
    const auto run = RunTutti({"run", "--config", config, "--dataset", testing::TinyTown(), "--out", out});
    ExpectRefused(run, out.string());
  }
}

TEST_F(BadInput, DamagedImagesInTheMiddleAreSkippedAndCounted) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  fs::resize_file(data / "image_0" / "000012.png", 3000);              // truncated
  testing::WriteAll(data / "image_0" / "000015.png", "not an image");  // unreadable
  testing::WriteAll(data / "image_1" / "000020.png", "not an image");  // of a frame that has its left image
  const cv::Mat small(100, 100, CV_8UC1, cv::Scalar(128));
  cv::imwrite((data / "image_0" / "000018.png").string(), small);  // of another size
  EXPECT_THAT(Done(Run(config_, data)),
              AllOf(HasSubstr("000012.png"), HasSubstr("000015.png"), HasSubstr("000018.png"),
                    HasSubstr("frame 20 is tracked without its right image: ")));
  EXPECT_EQ(Summary()["frames"]["bad"], 3);
  EXPECT_EQ(Summary()["frames"]["bad_depth"][0]["index"], 20);
  EXPECT_EQ(Summary()["frames"]["total"], testing::kTinyFrames);
  EXPECT_EQ(Summary()["frames"]["tracked"], testing::kTinyFrames - 3);
}

TEST_F(BadInput, AllImagesDamagedIsAVoidRun) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  for (const auto& entry : fs::directory_iterator(data / "image_0")) testing::WriteAll(entry.path(), "x");
  ExpectRefusal(Run(config_, data), {});
}

TEST_F(BadInput, BlankImagesAreAVoidRunThatStillWritesItsSummary) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  for (const char* side : {"image_0", "image_1"}) {
    for (const auto& entry : fs::directory_iterator(data / side)) {
      cv::imwrite(entry.path().string(), cv::Mat(240, 480, CV_8UC1, cv::Scalar(90)));
    }
  }
  ExpectRefusal(Run(config_, data), {"void"});
  EXPECT_EQ(Summary()["frames"]["tracked"], 0);
  EXPECT_TRUE(fs::exists(out_ / "trajectory.txt"));
}

TEST_F(BadInput, NotANumberInGroundTruthNamesFileAndLine) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  std::string text = ReadAll(data / "poses.txt");
  const std::size_t line = text.find('\n') + 1;
  text.replace(line, text.find(' ', line) - line, "nan");
  testing::WriteAll(data / "poses.txt", text);
  ExpectRefused(Run(config_, data), "poses.txt:2:");
}

TEST_F(BadInput, WrongNumberOfPosesNamesBothCounts) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  const std::string text = ReadAll(data / "poses.txt");
  testing::WriteAll(data / "poses.txt", text.substr(text.find('\n') + 1));
  const auto run = Run(config_, data);
  ExpectRefused(run, "poses.txt");
  EXPECT_THAT(run.output, AllOf(HasSubstr(std::to_string(testing::kTinyFrames)),
                                HasSubstr(std::to_string(testing::kTinyFrames - 1))));
}

TEST_F(BadInput, GroundTruthOfAnotherTimeKeepsTheRun) {
  testing::WriteAll(folder_ / "other.txt", "1000 0 0 0 0 0 0 1\n1001 1 0 0 0 0 0 1\n1002 1 1 0 0 0 0 1\n");
  EXPECT_THAT(Done(Run(config_, testing::TinyTown(), {"--ground-truth", folder_ / "other.txt"})),
              HasSubstr("no evaluation"));
  EXPECT_TRUE(fs::exists(out_ / "trajectory.txt"));
}

TEST_F(BadInput, GroundTruthThatRepeatsATimeStampIsUsedAndNoted) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  std::string text;
  for (int i = 0; i < 40; ++i) {
    const std::string line = std::to_string(0.1 * i) + " " + std::to_string(0.8 * i) + " 0 " +
                             std::to_string(0.02 * i * i) + " 0 0 0 1\n";
    text += line;
    if (i == 3) text += line;
  }
  testing::WriteAll(folder_ / "truth.txt", text);
  EXPECT_THAT(Done(Run(config_, data, {"--ground-truth", folder_ / "truth.txt"})),
              AllOf(HasSubstr("truth.txt:5: repeats the time stamp"), HasSubstr("ATE")));
}

TEST_F(BadInput, UnsortedTimeStampsAreRefusedWithTheirLine) {
  const fs::path data = testing::CopyOfTinyTown(folder_ / "data");
  std::string text = ReadAll(data / "times.txt");
  const std::size_t second = text.find('\n') + 1;
  text.replace(second, text.find('\n', second) - second, "99.0");
  testing::WriteAll(data / "times.txt", text);
  ExpectRefused(Run(config_, data), "times.txt:");
}

}  // namespace
}  // namespace tutti
