// `tutti close`: when plain images were taken, and depth images in a folder of their own.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <vector>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/small_room.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr int kRoomImages = 12;

// RGB-D in TUM's layout; images are called by their time stamps.
const fs::path& RoomOfImages() {
  static const fs::path room = testing::GeneratedDataset([] {
    SyntheticOptions options = testing::SmallRgbdRoom(320, 240);
    options.frames = kRoomImages;
    return options;
  }());
  return room;
}

std::string Text(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

class CloseImages : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::WriteAll(mono_,
                      "camera: {width: 320, height: 240, fx: 262.4, fy: 262.4, cx: 159.5, cy: 119.5}\n");
    WriteTrajectory(odometry_, Truth(), TrajectoryFormat::kTum);
  }

  static Trajectory Truth() {
    return ReadTrajectory(RoomOfImages() / "groundtruth.txt", TrajectoryFormat::kTum);
  }
  // A copy of a folder of the room whose images have other names.
  fs::path Renamed(const std::string& from, const std::function<std::string(int)>& name) const {
    fs::path to = folder_ / (from + "-renamed");
    fs::create_directories(to);
    std::vector<fs::path> images;
    for (const fs::directory_entry& entry : fs::directory_iterator(RoomOfImages() / from))
      images.push_back(entry);
    std::sort(images.begin(), images.end());
    for (std::size_t i = 0; i < images.size(); ++i)
      fs::copy(images[i], to / (name(static_cast<int>(i)) + ".png"));
    return to;
  }
  testing::ProcessResult Close(const fs::path& images, const fs::path& config, const std::string& out,
                               const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {
        "close",         "--trajectory", odometry_.string(),       "--images",   images.string(), "--config",
        config.string(), "--out",        (folder_ / out).string(), "--no-report"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::RunTutti(arguments);
  }
  std::string Graph(const std::string& out) const { return Text(folder_ / out / "graph.g2o"); }

  fs::path folder_ = testing::FreshFolder();
  fs::path mono_ = folder_ / "mono.yaml", odometry_ = folder_ / "odometry.txt";
};

TEST_F(CloseImages, ArePairedWithPosesByTheTimeStampsThatTheyAreCalledBy) {
  const auto seconds = Close(RoomOfImages() / "rgb", mono_, "seconds");
  ASSERT_EQ(seconds.status, 0) << seconds.output;
  EXPECT_THAT(seconds.output, HasSubstr("the time stamps that they are called by"));
  EXPECT_THAT(seconds.output, HasSubstr("frames 12 of 12"));
  // The poses are later than the images by the time of half of these: only they have a pose.
  Trajectory later = Truth();
  for (StampedPose& p : later) p.stamp_s += 6.0 / 15;
  WriteTrajectory(odometry_, later, TrajectoryFormat::kTum);
  const auto half = Close(RoomOfImages() / "rgb", mono_, "half", {"--require", "failed"});
  ASSERT_EQ(half.status, 0) << half.output;
  EXPECT_THAT(half.output, HasSubstr("frames 6 of 12"));
}

TEST_F(CloseImages, MayBeCalledByNanoseconds) {
  Trajectory poses = Truth();
  for (StampedPose& p : poses) p.stamp_s += 1.4e9;
  WriteTrajectory(odometry_, poses, TrajectoryFormat::kTum);
  const fs::path images = Renamed("rgb", [](int i) {
    return std::to_string(1400000000000000000LL + static_cast<long long>(i) * 1000000000LL / 15);
  });
  const auto done = Close(images, mono_, "out");
  ASSERT_EQ(done.status, 0) << done.output;
  EXPECT_THAT(done.output, HasSubstr("the time stamps that they are called by"));
  EXPECT_THAT(done.output, HasSubstr("frames 12 of 12"));
}

TEST_F(CloseImages, ArePairedByOrderIfThereAreAsManyPosesAndRefusedElse) {
  const fs::path images = Renamed("rgb", [](int i) { return std::to_string(i); });
  const auto order = Close(images, mono_, "order");
  ASSERT_EQ(order.status, 0) << order.output;
  EXPECT_THAT(order.output, HasSubstr("the pose of the same place in the file"));
  ASSERT_EQ(Close(RoomOfImages() / "rgb", mono_, "names").status, 0);
  EXPECT_EQ(Graph("order"), Graph("names"));
  Trajectory fewer = Truth();
  fewer.pop_back();
  WriteTrajectory(odometry_, fewer, TrajectoryFormat::kTum);
  const auto refused = Close(images, mono_, "refused");
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.output, HasSubstr("nothing says when its 12 images were taken"));
  EXPECT_THAT(refused.output, HasSubstr("--times FILE"));
}

TEST_F(CloseImages, GetDepthFromAFolderBeside) {
  ASSERT_EQ(Close(RoomOfImages(), RoomOfImages() / "config.yaml", "layout").status, 0);
  ASSERT_EQ(Close(RoomOfImages() / "rgb", mono_, "mono").status, 0);
  const std::vector<std::string> depth = {"--depth", (RoomOfImages() / "depth").string(), "--set",
                                          "dataset.max_depth_m=8"};
  const auto beside = Close(RoomOfImages() / "rgb", mono_, "beside", depth);
  ASSERT_EQ(beside.status, 0) << beside.output;
  EXPECT_EQ(Graph("beside"), Graph("layout"));
  EXPECT_NE(Graph("beside"), Graph("mono"));
  // Fewer: by their names.
  const fs::path few = Renamed("depth", [](int i) {
    char name[40];
    std::snprintf(name, sizeof name, "%.6f", (i + 0.1) / 15);
    return std::string(name);
  });
  fs::remove(few / "0.073333.png");
  const auto fewer = Close(RoomOfImages() / "rgb", mono_, "fewer", {"--depth", few.string()});
  ASSERT_EQ(fewer.status, 0) << fewer.output;
  EXPECT_THAT(fewer.output, HasSubstr("1 of 12 images have no depth image within"));
}

TEST_F(CloseImages, SayWhatIsWrongWithDepth) {
  const auto refused = [&](const fs::path& images, const fs::path& depth, const std::string& words) {
    const auto done = Close(images, mono_, "out", {"--depth", depth.string()});
    EXPECT_EQ(done.status, 1) << done.output;
    EXPECT_THAT(done.output, HasSubstr(words));
  };
  refused(RoomOfImages() / "rgb", folder_ / "nowhere", "nowhere");
  refused(RoomOfImages(), RoomOfImages() / "depth", "--depth goes with a plain folder of images");
  const fs::path far = Renamed("depth", [](int i) { return "9" + std::to_string(i); });
  fs::remove(far / "90.png");
  refused(RoomOfImages() / "rgb", far, "has 11 depth images for 12 images");
}

}  // namespace
}  // namespace tutti
