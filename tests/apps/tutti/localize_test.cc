// `tutti localize`: frames in the map of another run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/in_folder.h"
#include "tests/support/small_town.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;

SyntheticOptions TownToLocalizeIn(std::uint64_t seed) {
  SyntheticOptions options = testing::SmallStereoTownWithALoop(320, 160);
  options.laps = 1.6;
  options.seed = seed;
  return options;
}

class LocalizeCommand : public ::testing::Test {
 protected:
  testing::ProcessResult Localize(const fs::path& dataset, const std::vector<std::string>& more) const {
    std::vector<std::string> words = {"localize",       "--map", map_.string(), "--dataset",
                                      dataset.string(), "--out", out_.string()};
    words.insert(words.end(), more.begin(), more.end());
    return RunTutti(words);
  }
  static constexpr int kMapped = 175;  // of the frames: one lap
  const fs::path town_ = testing::GeneratedDataset(TownToLocalizeIn(1));
  const fs::path run_ = testing::RunMadeOnce(town_ / "config.yaml", town_,
                                             {"--end", std::to_string(kMapped), "--no-report"}),
                 map_ = run_ / "map.tutti", out_ = testing::FreshFolder() / "out";
};

TEST_F(LocalizeCommand, FramesOfASecondLapAreFoundInTheMapOfTheFirstWhichStaysAsItIs) {
  const std::string before = ReadAll(map_);
  const auto run = Localize(town_, {"--start", std::to_string(kMapped)});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_EQ(ReadAll(map_) == before, true) << "the map's bytes have changed";
  const auto summary = nlohmann::json::parse(ReadAll(out_ / "summary.json"));
  const double total = summary["frames"]["total"], localized = summary["frames"]["localized"];
  EXPECT_GE(localized, 0.95 * total);
  EXPECT_LT(static_cast<double>(summary["time"]["first_pose_s"]), 60);
  // The world is the map's, whose first camera is where the truth begins.
  const Trajectory found = ReadTrajectory(out_ / "trajectory.txt", TrajectoryFormat::kTum);
  EXPECT_EQ(static_cast<double>(found.size()), localized);
  const Trajectory truth = ReadTrajectory(town_ / "poses.txt", TrajectoryFormat::kKitti);
  double worst = 0;
  for (const StampedPose& pose : found) {
    const auto frame = static_cast<std::size_t>(std::lround(pose.stamp_s * 4.5));
    const Eigen::Vector3d expected = truth.front().pose.Inverse() * truth[frame].pose.translation;
    worst = std::max(worst, (pose.pose.translation - expected).norm());
  }
  EXPECT_LT(worst, 1.5);
  std::printf("  %.0f of %.0f frames, worst %.2f m\n", localized, total, worst);
  // Each frame has a line, with how sure it is.
  const std::string csv = ReadAll(out_ / "localization.csv");
  EXPECT_THAT(csv, ::testing::StartsWith("frame,stamp_s,state,recognised,keyframe,inliers,position_sigma_m"));
  EXPECT_EQ(static_cast<double>(std::count(csv.begin(), csv.end(), '\n')), total + 1);
  EXPECT_THAT(ReadAll(out_ / "localization.svg"), HasSubstr("beyond the map"));
}

TEST_F(LocalizeCommand, MapAndRecordingAreEnough) {
  const std::string town = fs::absolute(town_), map = fs::absolute(map_);
  const testing::InFolder here(testing::FreshFolder());
  const auto run = RunTutti({"localize", town, "--map", map, "--start", "180", "--end", "184"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_TRUE(fs::exists("tutti-out/" + town_.filename().string() + "-localized/trajectory.txt"))
      << run.output;
}

TEST_F(LocalizeCommand, TheResultDoesNotDependOnTheThreads) {
  const std::string start = std::to_string(kMapped + 20);
  ASSERT_EQ(Localize(town_, {"--start", start, "--threads", "1"}).status, 0);
  const std::string one = ReadAll(out_ / "trajectory.txt");
  ASSERT_EQ(Localize(town_, {"--start", start, "--threads", "2"}).status, 0);
  EXPECT_EQ(ReadAll(out_ / "trajectory.txt") == one, true);
}

TEST_F(LocalizeCommand, InTheMapOfAnotherTownNoFrameIsFound) {
  const fs::path other = testing::GeneratedDataset(TownToLocalizeIn(7));
  const auto run = Localize(other, {"--end", "60"});
  EXPECT_EQ(run.status, 1) << run.output;
  EXPECT_THAT(run.output, HasSubstr("not one frame was found in the map"));
  EXPECT_EQ(nlohmann::json::parse(ReadAll(out_ / "summary.json"))["frames"]["localized"], 0);
}

TEST_F(LocalizeCommand, AnotherCameraAndAFolderThatHoldsTheMapAreRefused) {
  SyntheticOptions options = TownToLocalizeIn(1);
  options.width = 400;
  const fs::path wider = testing::GeneratedDataset(options);
  const auto camera = Localize(wider, {"--config", (wider / "config.yaml").string()});
  EXPECT_EQ(camera.status, 1);
  EXPECT_THAT(camera.output, HasSubstr("has another camera than the map"));
  const auto inside =
      RunTutti({"localize", "--map", map_.string(), "--dataset", town_.string(), "--out", run_.string()});
  EXPECT_EQ(inside.status, 1);
  EXPECT_THAT(inside.output, HasSubstr("choose another --out"));
  EXPECT_TRUE(fs::exists(map_));
}

}  // namespace
}  // namespace tutti
