// `tutti close`: formats, time stamps, and input that can't be used.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/in_folder.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
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
    std::vector<std::string> arguments = {
        "close",          "--trajectory", trajectory.string(),        "--images", images.string(), "--config",
        config_.string(), "--out",        (folder_ / "out").string(), "--quiet",  "--no-report"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunTutti(arguments);
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
    const auto done = Close(file, testing::TinyTown());
    ASSERT_EQ(done.status, 0) << done.output;
    const Trajectory out = Corrected();
    ASSERT_EQ(out.size(), poses.size()) << done.output;
    for (std::size_t i = 0; i < out.size(); ++i) {
      EXPECT_NEAR(out[i].stamp_s, poses[i].stamp_s, 1e-6);
      EXPECT_LT((out[i].pose.translation - poses[i].pose.translation).norm(), 1e-5) << i;
    }
    EXPECT_TRUE(fs::exists(folder_ / "out" / "graph.g2o"));
    EXPECT_THAT(done.output, HasSubstr("  good: nothing that the run shows"));
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
    const auto done = Close(trajectory, testing::TinyTown(), more);
    EXPECT_EQ(done.status, 0) << done.output;
    return testing::ReadAll(folder_ / "out" / "graph.g2o");
  };
  const std::string in_columns = graph(folder_ / "columns.txt", {});
  EXPECT_EQ(graph(folder_ / "odometry.txt", {"--odometry-sigma", (folder_ / "sigmas.txt").string()}),
            in_columns);
  const auto stated = [&] {
    return nlohmann::json::parse(
        testing::ReadAll(folder_ / "out" / "summary.json"))["given_odometry"]["stated"];
  };
  EXPECT_GT(stated()["rotation_deg"], 2);  // of several motions
  EXPECT_NE(graph(folder_ / "odometry.txt", {}), in_columns);
  EXPECT_NEAR(stated()["fraction"], 0.01, 1e-9);  // the default
  // KITTI's lines get the stamps of the images before those of the deviations are looked at.
  WriteTrajectory(folder_ / "kitti.txt", poses, TrajectoryFormat::kKitti);
  std::string stamped;
  for (const StampedPose& pose : poses) stamped += std::to_string(pose.stamp_s) + " 0.25 2\n";
  testing::WriteAll(folder_ / "stamped.txt", stamped);
  graph(folder_ / "kitti.txt", {"--odometry-sigma", (folder_ / "stamped.txt").string()});
  testing::WriteAll(folder_ / "few.txt", "0 0\n");
  const auto few = Close(folder_ / "odometry.txt", testing::TinyTown(),
                         {"--odometry-sigma", (folder_ / "few.txt").string()});
  EXPECT_EQ(few.status, 1);
  EXPECT_THAT(few.output, HasSubstr("few.txt: has 1 lines for"));
}

TEST_F(CloseCommand, PosesWithoutAnImageAreCorrectedToo) {
  const Trajectory poses = TownPoses();
  WriteTrajectory(folder_ / "odometry.txt", poses, TrajectoryFormat::kTum);
  const auto done = Close(folder_ / "odometry.txt", testing::TinyTown(), {"--stride", "2"});
  ASSERT_EQ(done.status, 0) << done.output;
  EXPECT_EQ(Corrected().size(), poses.size());
}

TEST_F(CloseCommand, APoseThatIsOffIsSaidAndMovesNoOther) {
  const Trajectory poses = TownPoses();
  for (const double metres : {3.0, 1e10}) {
    Trajectory bad = poses;
    bad[14].pose.translation.y() += metres;
    WriteTrajectory(folder_ / "odometry.txt", bad, TrajectoryFormat::kTum);
    const auto done = Close(folder_ / "odometry.txt", testing::TinyTown());
    ASSERT_EQ(done.status, 0) << done.output;
    EXPECT_THAT(done.output, HasSubstr("  doubtful:"));
    EXPECT_THAT(done.output, HasSubstr("the given odometry has jumps: 1;"));
    const Trajectory out = Corrected();
    ASSERT_EQ(out.size(), poses.size()) << done.output;
    for (std::size_t i = 0; i < out.size(); ++i)
      EXPECT_LT((out[i].pose.translation - poses[i].pose.translation).norm(), i == 14 ? 0.2 : 1e-5) << i;
    const auto jumps =
        nlohmann::json::parse(testing::ReadAll(folder_ / "out" / "summary.json"))["given_odometry"]["jumps"];
    ASSERT_EQ(jumps.size(), 1U);
    EXPECT_NEAR(jumps[0]["from_s"], poses[13].stamp_s, 1e-6);
    EXPECT_NEAR(jumps[0]["distance_m"], metres, 0.2 + 1e-6 * metres);
    EXPECT_EQ(jumps[0]["comes_back"], true);
  }
}

TEST_F(CloseCommand, AFolderOfImagesGetsItsStampsFromTimesAboveItOrFromTheOption) {
  WriteTrajectory(folder_ / "odometry.txt", TownPoses(), TrajectoryFormat::kTum);
  const fs::path images = testing::TinyTown() / "image_0";
  const auto above = RunTutti({"close", "--trajectory", (folder_ / "odometry.txt").string(), "--images",
                               images.string(), "--out", (folder_ / "out").string(), "--no-report"});
  ASSERT_EQ(above.status, 0) << above.output;
  EXPECT_THAT(above.output, HasSubstr("times.txt"));
  EXPECT_THAT(above.output, HasSubstr("without a calibration"));
  EXPECT_TRUE(fs::exists(folder_ / "out" / "loops.csv"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "trajectory.txt"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "graph.g2o"));
  testing::WriteAll(folder_ / "few.txt", "0\n1\n");
  const auto few =
      RunTutti({"close", "--trajectory", (folder_ / "odometry.txt").string(), "--images", images.string(),
                "--out", (folder_ / "out").string(), "--times", (folder_ / "few.txt").string()});
  EXPECT_EQ(few.status, 1);
  EXPECT_THAT(few.output, HasSubstr("few.txt: has 2 time stamps"));
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
  const auto both = RunTutti({"close", "--trajectory", odometry, "--images", town, "--fov", "3"});
  EXPECT_NE(both.status, 0);
  EXPECT_THAT(both.output, HasSubstr("from 5 to 170"));
}

TEST_F(CloseCommand, Example08DoesTheSameInCode) {
  WriteTrajectory(folder_ / "odometry.txt", TownPoses(), TrajectoryFormat::kTum);
  const auto done = testing::RunProgramAndSignal(
      TUTTI_EXAMPLE_08,
      {config_.string(), testing::TinyTown().string(), (folder_ / "odometry.txt").string(),
       (folder_ / "corrected.txt").string()},
      "", 0);
  ASSERT_EQ(done.status, 0) << done.output;
  EXPECT_THAT(done.output, HasSubstr("keyframes"));
  EXPECT_EQ(ReadTrajectory(folder_ / "corrected.txt", TrajectoryFormat::kTum).size(), TownPoses().size());
}

// The odometry of an earlier run, closed into that run's folder.
TEST_F(CloseCommand, TheResultDoesNotReplaceTheOdometryThatItIsMadeOf) {
  const fs::path own = folder_ / "out" / "trajectory.txt";
  fs::create_directories(folder_ / "out");
  WriteTrajectory(own, TownPoses(), TrajectoryFormat::kTum);
  const std::string before = testing::ReadAll(own);
  const auto refused = Close(own, testing::TinyTown());
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.output, HasSubstr("which this run reads; choose another --out"));
  EXPECT_EQ(testing::ReadAll(own), before);
}

TEST_F(CloseCommand, RefusesWhatCanNotBeUsedAndSaysWhy) {
  const auto refused = [&](const fs::path& file, const std::string& words) {
    const auto done = Close(file, testing::TinyTown());
    EXPECT_EQ(done.status, 1) << done.output;
    EXPECT_THAT(done.output, HasSubstr(words));
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
  const auto images = Close(folder_ / "good.txt", folder_ / "nowhere");
  EXPECT_EQ(images.status, 1);
  EXPECT_THAT(images.output, HasSubstr("nowhere"));
  const auto sigma = Close(folder_ / "good.txt", testing::TinyTown(), {"--odometry-sigma", "-1", "0.1"});
  EXPECT_EQ(sigma.status, 1);
  EXPECT_THAT(sigma.output, HasSubstr("--odometry-sigma"));
}

}  // namespace
}  // namespace tutti
