// `tutti run` and `tutti close` on a video whose frames have no constant rate, and through a pipe.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/matroska_writer.h"
#include "tests/support/pipe_sender.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::RunTutti;

class VideoOfTheTown : public ::testing::Test {
 protected:
  void SetUp() override {
    std::vector<fs::path> images;
    for (const auto& entry : fs::directory_iterator(testing::TinyTown() / "image_0"))
      images.push_back(entry.path());
    std::sort(images.begin(), images.end());
    const cv::Mat first = cv::imread(images.front().string());
    testing::MatroskaWriter writer(first.size());
    for (std::size_t i = 0; i < images.size(); ++i) {
      const int milliseconds = 100 * static_cast<int>(i) + (i % 3 == 1 ? 47 : 0);
      stamps_s_.push_back(1e-3 * milliseconds);
      writer.Add(cv::imread(images[i].string()), milliseconds);
    }
    writer.Write(video_);
    char text[80];
    std::snprintf(text, sizeof text, "%d,%d,%d,%d", first.cols, first.cols, first.cols / 2, first.rows / 2);
    camera_ = text;
  }
  testing::ProcessResult Run(const fs::path& video, const std::string& out) const {
    return RunTutti({"run", video.string(), "--camera", camera_, "--no-report", "--no-map", "--out",
                     (folder_ / out).string()});
  }
  // Each pose has the stamp of one of the frames.
  void ExpectStampsOfTheVideo(const std::string& out) const {
    const Trajectory poses = ReadTrajectory(folder_ / out / "trajectory.txt", TrajectoryFormat::kTum);
    EXPECT_GT(poses.size(), 10u);
    for (const StampedPose& pose : poses) {
      EXPECT_TRUE(std::any_of(stamps_s_.begin(), stamps_s_.end(), [&](double s) {
        return std::abs(s - pose.stamp_s) < 1e-6;
      })) << pose.stamp_s;
    }
  }

  const fs::path folder_ = testing::FreshFolder(), video_ = folder_ / "town.mkv";
  std::vector<double> stamps_s_;
  std::string camera_;
};

TEST_F(VideoOfTheTown, IsRunWithTheTimesOfItsContainerAlsoThroughAPipe) {
  const auto of_file = Run(video_, "file");
  EXPECT_EQ(of_file.status, 0) << of_file.output;
  ExpectStampsOfTheVideo("file");
  const fs::path pipe = folder_ / "pipe";
  const testing::PipeSender sender(pipe, testing::ReadAll(video_));
  const auto of_pipe = Run(pipe, "pipe_out");
  EXPECT_EQ(of_pipe.status, 0) << of_pipe.output;
  EXPECT_THAT(of_pipe.output, HasSubstr("a video through a pipe"));
  ExpectStampsOfTheVideo("pipe_out");
}

TEST_F(VideoOfTheTown, IsClosedByTheTimesOfItsContainer) {
  Trajectory poses = ReadTrajectory(testing::TinyTown() / "poses.txt", TrajectoryFormat::kKitti);
  ASSERT_EQ(poses.size(), stamps_s_.size());
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i].stamp_s = stamps_s_[i];
  poses.erase(poses.begin() + 5);  // not one for each frame
  WriteTrajectory(folder_ / "odometry.txt", poses, TrajectoryFormat::kTum);
  const auto closed =
      RunTutti({"close", "--trajectory", (folder_ / "odometry.txt").string(), "--images", video_.string(),
                "--camera", camera_, "--no-report", "--out", (folder_ / "closed").string()});
  EXPECT_EQ(closed.status, 0) << closed.output;
  EXPECT_THAT(closed.output, HasSubstr("the frames have the time stamps of the video"));
  const auto summary = nlohmann::json::parse(testing::ReadAll(folder_ / "closed" / "summary.json"));
  EXPECT_EQ(summary["frames"]["tracked"], stamps_s_.size());
}

TEST_F(VideoOfTheTown, ThroughAPipeIsRefusedWhereAllFramesAreNeeded) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& name : {pipe.string(), std::string("-")}) {
    const auto loops = RunTutti({"loops", name, "--out", (folder_ / "out").string()});
    EXPECT_EQ(loops.status, 1);
    EXPECT_THAT(loops.output, HasSubstr(name + ": gives its frames once"));
  }
}

TEST(EveryCommandThatTakesImages, TakesACamera) {
  for (const char* name : {"run", "close", "localize", "compare", "calibrate-check", "loops"})
    EXPECT_THAT(RunTutti({name, "--help"}).output, HasSubstr("--camera")) << name;
  const auto checked =
      RunTutti({"calibrate-check", (testing::TinyTown() / "image_0").string(), "--camera", "333,334,100,50"});
  EXPECT_THAT(checked.output, HasSubstr("fx 333.00, fy 334.00"));
}

}  // namespace
}  // namespace tutti
