// `tutti close`: formats, time stamps of poses and images, depth, and input that can't be used.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vector>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/in_folder.h"
#include "tests/support/small_room.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using testing::RunTutti;

// The town's poses with the stamps of its images.
Trajectory TownPoses() {
  const std::vector<double> times = ReadTimes(testing::TinyTown() / "times.txt");
  Trajectory poses = ReadTrajectory(testing::TinyTown() / "poses.txt", TrajectoryFormat::kKitti);
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i].stamp_s = times[i];
  return poses;
}

class CloseCommand : public ::testing::Test {
 protected:
  testing::ProcessResult Close(const fs::path& trajectory, const fs::path& images,
                               const std::vector<std::string>& more = {}) const {
    return RunTutti({"close", "--trajectory", trajectory, "--images", images, "--config", config_, "--out",
                     folder_ / "out", "--quiet", "--no-report"},
                    more);
  }
  Trajectory Corrected() const {
    return ReadTrajectory(folder_ / "out" / "trajectory.txt", TrajectoryFormat::kTum);
  }

  fs::path folder_ = testing::FreshFolder();
  fs::path config_ = testing::TinyConfig(folder_);
};

TEST_F(CloseCommand, ReadsTumKittiAndEurocAndGivesBackEveryPose) {
  const Trajectory poses = TownPoses();
  for (const TrajectoryFormat format :
       {TrajectoryFormat::kTum, TrajectoryFormat::kKitti, TrajectoryFormat::kEuroc}) {
    const fs::path file = folder_ / "odometry.txt";
    WriteTrajectory(file, poses, format);
    const std::string done = Done(Close(file, testing::TinyTown()));
    const Trajectory out = Corrected();
    ASSERT_EQ(out.size(), poses.size()) << done;
    for (std::size_t i = 0; i < out.size(); ++i) {
      EXPECT_NEAR(out[i].stamp_s, poses[i].stamp_s, 1e-6);
      EXPECT_LT((out[i].pose.translation - poses[i].pose.translation).norm(), 1e-5) << i;
    }
    EXPECT_TRUE(fs::exists(folder_ / "out" / "graph.g2o"));
    EXPECT_THAT(done, HasSubstr("  good: nothing that the run shows"));
    EXPECT_TRUE(fs::exists(folder_ / "out" / "loops.csv"));
    EXPECT_TRUE(fs::exists(folder_ / "out" / "trajectory_odometry.txt"));
  }
}

TEST_F(CloseCommand, TheOdometrySaysHowUncertainItIsInColumnsOrAFile) {
  const Trajectory poses = TownPoses();
  WriteTrajectory(folder_ / "odometry.txt", poses, TrajectoryFormat::kTum);
  std::ifstream in(folder_ / "odometry.txt");
  std::string columns, lines;
  for (std::string line; std::getline(in, line);) {
    columns += line[0] == '#' ? line + "\n" : line + " 0.25 2\n";
    if (line[0] != '#') lines += "0.25 2\n";
  }
  testing::WriteAll(folder_ / "columns.txt", columns);
  testing::WriteAll(folder_ / "sigmas.txt", lines);
  const auto graph = [&](const fs::path& trajectory, const std::vector<std::string>& more) {
    Done(Close(trajectory, testing::TinyTown(), more));
    return testing::ReadAll(folder_ / "out" / "graph.g2o");
  };
  const std::string in_columns = graph(folder_ / "columns.txt", {});
  EXPECT_EQ(graph(folder_ / "odometry.txt", {"--odometry-sigma", folder_ / "sigmas.txt"}), in_columns);
  const auto stated = [&] {
    return testing::ReadJson(folder_ / "out" / "summary.json")["given_odometry"]["stated"];
  };
  EXPECT_GT(stated()["rotation_deg"], 2);  // of several motions
  EXPECT_NE(graph(folder_ / "odometry.txt", {}), in_columns);
  EXPECT_NEAR(stated()["fraction"], 0.01, 1e-9);  // the default
  // KITTI's lines get the stamps of the images before those of the deviations are looked at.
  WriteTrajectory(folder_ / "kitti.txt", poses, TrajectoryFormat::kKitti);
  std::string stamped;
  for (const StampedPose& pose : poses) stamped += std::to_string(pose.stamp_s) + " 0.25 2\n";
  testing::WriteAll(folder_ / "stamped.txt", stamped);
  graph(folder_ / "kitti.txt", {"--odometry-sigma", folder_ / "stamped.txt"});
  testing::WriteAll(folder_ / "few.txt", "0 0\n");
  ExpectRefusal(
      Close(folder_ / "odometry.txt", testing::TinyTown(), {"--odometry-sigma", folder_ / "few.txt"}),
      {"few.txt: has 1 lines for"});
}

TEST_F(CloseCommand, PosesWithoutAnImageAreCorrectedToo) {
  const Trajectory poses = TownPoses();
  WriteTrajectory(folder_ / "odometry.txt", poses, TrajectoryFormat::kTum);
  Done(Close(folder_ / "odometry.txt", testing::TinyTown(), {"--stride", "2"}));
  EXPECT_EQ(Corrected().size(), poses.size());
}

TEST_F(CloseCommand, APoseThatIsOffIsSaidAndMovesNoOther) {
  const Trajectory poses = TownPoses();
  for (const double metres : {3.0, 1e10}) {
    Trajectory bad = poses;
    bad[14].pose.translation.y() += metres;
    WriteTrajectory(folder_ / "odometry.txt", bad, TrajectoryFormat::kTum);
    const std::string done = Done(Close(folder_ / "odometry.txt", testing::TinyTown()));
    EXPECT_THAT(done, HasSubstr("  doubtful:"));
    EXPECT_THAT(done, HasSubstr("the given odometry has jumps: 1;"));
    const Trajectory out = Corrected();
    ASSERT_EQ(out.size(), poses.size()) << done;
    for (std::size_t i = 0; i < out.size(); ++i)
      EXPECT_LT((out[i].pose.translation - poses[i].pose.translation).norm(), i == 14 ? 0.2 : 1e-5) << i;
    const auto jumps = testing::ReadJson(folder_ / "out" / "summary.json")["given_odometry"]["jumps"];
    ASSERT_EQ(jumps.size(), 1U);
    EXPECT_NEAR(jumps[0]["from_s"], poses[13].stamp_s, 1e-6);
    EXPECT_NEAR(jumps[0]["distance_m"], metres, 0.2 + 1e-6 * metres);
    EXPECT_EQ(jumps[0]["comes_back"], true);
  }
}

TEST_F(CloseCommand, AFolderOfImagesGetsItsStampsFromTimesAboveItOrFromTheOption) {
  WriteTrajectory(folder_ / "odometry.txt", TownPoses(), TrajectoryFormat::kTum);
  const fs::path images = testing::TinyTown() / "image_0";
  const std::string above = Done(RunTutti({"close", "--trajectory", folder_ / "odometry.txt", "--images",
                                           images, "--out", folder_ / "out", "--no-report"}));
  EXPECT_THAT(above, HasSubstr("times.txt"));
  EXPECT_THAT(above, HasSubstr("without a calibration"));
  EXPECT_TRUE(fs::exists(folder_ / "out" / "loops.csv"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "trajectory.txt"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "graph.g2o"));
  testing::WriteAll(folder_ / "few.txt", "0\n1\n");
  ExpectRefusal(RunTutti({"close", "--trajectory", folder_ / "odometry.txt", "--images", images, "--out",
                          folder_ / "out", "--times", folder_ / "few.txt"}),
                {"few.txt: has 2 time stamps"});
}

TEST_F(CloseCommand, FindsTheCameraInTheRecordingOrTakesItFromTheOptions) {
  WriteTrajectory(folder_ / "odometry.txt", TownPoses(), TrajectoryFormat::kTum);
  const std::string odometry = fs::absolute(folder_ / "odometry.txt"),
                    town = fs::absolute(testing::TinyTown());
  const testing::InFolder here(folder_);
  const auto stereo = RunTutti({"close", "--trajectory", odometry, "--images", town, "--no-report"});
  ASSERT_EQ(stereo.status, 0) << stereo.output;
  EXPECT_THAT(stereo.output, HasSubstr("stereo"));
  EXPECT_TRUE(fs::exists("tutti-out/" + fs::path(town).filename().string() + "-closed/graph.g2o"))
      << stereo.output;
  const auto images =
      RunTutti({"close", "--trajectory", odometry, "--images", town + "/image_0", "--camera",
                "185,185,159.5,79.5", "--no-report", "--require", "failed", "--out", "images"});
  ASSERT_EQ(images.status, 0) << images.output;
  EXPECT_TRUE(fs::exists("images/graph.g2o")) << images.output;
  ExpectRefusal(RunTutti({"close", "--trajectory", odometry, "--images", town, "--fov", "3"}),
                {"from 5 to 170"});
}

TEST_F(CloseCommand, Example08DoesTheSameInCode) {
  WriteTrajectory(folder_ / "odometry.txt", TownPoses(), TrajectoryFormat::kTum);
  EXPECT_THAT(
      Done(testing::RunProgramAndSignal(
          TUTTI_EXAMPLE_08,
          {config_, testing::TinyTown(), folder_ / "odometry.txt", folder_ / "corrected.txt"}, "", 0)),
      HasSubstr("keyframes"));
  EXPECT_EQ(ReadTrajectory(folder_ / "corrected.txt", TrajectoryFormat::kTum).size(), TownPoses().size());
}

// The odometry of an earlier run, closed into that run's folder.
TEST_F(CloseCommand, TheResultDoesNotReplaceTheOdometryThatItIsMadeOf) {
  const fs::path own = folder_ / "out" / "trajectory.txt";
  fs::create_directories(folder_ / "out");
  WriteTrajectory(own, TownPoses(), TrajectoryFormat::kTum);
  const std::string before = testing::ReadAll(own);
  ExpectRefusal(Close(own, testing::TinyTown()), {"which this run reads; choose another --out"});
  EXPECT_EQ(testing::ReadAll(own), before);
}

TEST_F(CloseCommand, RefusesWhatCanNotBeUsedAndSaysWhy) {
  const auto refused = [&](const fs::path& file, const std::string& words) {
    ExpectRefusal(Close(file, testing::TinyTown()), {words});
    EXPECT_FALSE(fs::exists(folder_ / "out" / "trajectory.txt"));
  };
  refused(folder_ / "absent.txt", "absent.txt");
  testing::WriteAll(folder_ / "nan.txt", "0 0 0 0 0 0 0 1\n0.1 nan 0 0 0 0 0 1\n");
  refused(folder_ / "nan.txt", "nan.txt:2");
  testing::WriteAll(folder_ / "back.txt", "1 0 0 0 0 0 0 1\n0.1 0 0 0 0 0 0 1\n");
  refused(folder_ / "back.txt", "back.txt:2");
  testing::WriteAll(folder_ / "empty.txt", "# nothing\n");
  refused(folder_ / "empty.txt", "empty.txt");
  Trajectory later = TownPoses();
  for (StampedPose& p : later) p.stamp_s += 1e6;
  WriteTrajectory(folder_ / "later.txt", later, TrajectoryFormat::kTum);
  refused(folder_ / "later.txt", "has no pose for any image");
  WriteTrajectory(folder_ / "short.txt", {later.begin(), later.begin() + 5}, TrajectoryFormat::kKitti);
  refused(folder_ / "short.txt", "5 poses for 30 images");
  WriteTrajectory(folder_ / "good.txt", TownPoses(), TrajectoryFormat::kTum);
  ExpectRefusal(Close(folder_ / "good.txt", folder_ / "nowhere"), {"nowhere"});
  ExpectRefusal(Close(folder_ / "good.txt", testing::TinyTown(), {"--odometry-sigma", "-1", "0.1"}),
                {"--odometry-sigma"});
}

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
    return testing::RunTutti({"close", "--trajectory", odometry_, "--images", images, "--config", config,
                              "--out", folder_ / out, "--no-report"},
                             more);
  }
  std::string Graph(const std::string& out) const { return Text(folder_ / out / "graph.g2o"); }

  fs::path folder_ = testing::FreshFolder();
  fs::path mono_ = folder_ / "mono.yaml", odometry_ = folder_ / "odometry.txt";
};

TEST_F(CloseImages, ArePairedWithPosesByTheTimeStampsThatTheyAreCalledBy) {
  const std::string seconds = Done(Close(RoomOfImages() / "rgb", mono_, "seconds"));
  EXPECT_THAT(seconds, HasSubstr("the time stamps that they are called by"));
  EXPECT_THAT(seconds, HasSubstr("frames 12 of 12"));
  // The poses are later than the images by the time of half of these: only they have a pose.
  Trajectory later = Truth();
  for (StampedPose& p : later) p.stamp_s += 6.0 / 15;
  WriteTrajectory(odometry_, later, TrajectoryFormat::kTum);
  EXPECT_THAT(Done(Close(RoomOfImages() / "rgb", mono_, "half", {"--require", "failed"})),
              HasSubstr("frames 6 of 12"));
}

TEST_F(CloseImages, MayBeCalledByNanoseconds) {
  Trajectory poses = Truth();
  for (StampedPose& p : poses) p.stamp_s += 1.4e9;
  WriteTrajectory(odometry_, poses, TrajectoryFormat::kTum);
  const fs::path images = Renamed("rgb", [](int i) {
    return std::to_string(1400000000000000000LL + static_cast<long long>(i) * 1000000000LL / 15);
  });
  const std::string done = Done(Close(images, mono_, "out"));
  EXPECT_THAT(done, HasSubstr("the time stamps that they are called by"));
  EXPECT_THAT(done, HasSubstr("frames 12 of 12"));
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
  ExpectRefusal(Close(images, mono_, "refused"),
                {"nothing says when its 12 images were taken", "--times FILE"});
}

TEST_F(CloseImages, GetDepthFromAFolderBeside) {
  ASSERT_EQ(Close(RoomOfImages(), RoomOfImages() / "config.yaml", "layout").status, 0);
  ASSERT_EQ(Close(RoomOfImages() / "rgb", mono_, "mono").status, 0);
  const std::vector<std::string> depth = {"--depth", RoomOfImages() / "depth", "--set",
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
  EXPECT_THAT(Done(Close(RoomOfImages() / "rgb", mono_, "fewer", {"--depth", few})),
              HasSubstr("1 of 12 images have no depth image within"));
}

TEST_F(CloseImages, SayWhatIsWrongWithDepth) {
  const auto refused = [&](const fs::path& images, const fs::path& depth, const std::string& words) {
    ExpectRefusal(Close(images, mono_, "out", {"--depth", depth}), {words});
  };
  refused(RoomOfImages() / "rgb", folder_ / "nowhere", "nowhere");
  refused(RoomOfImages(), RoomOfImages() / "depth", "--depth goes with a plain folder of images");
  const fs::path far = Renamed("depth", [](int i) { return "9" + std::to_string(i); });
  fs::remove(far / "90.png");
  refused(RoomOfImages() / "rgb", far, "has 11 depth images for 12 images");
}

}  // namespace
}  // namespace tutti
