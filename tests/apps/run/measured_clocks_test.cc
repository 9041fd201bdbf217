// Runs on an RGB-D camera that reads its rows in 25 ms and takes depth 15 ms before its time stamps, untold.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "apps/run/camera_clocks.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadAll;
using testing::RunTutti;

SyntheticOptions RoomInAHand(bool kinect) {
  SyntheticOptions options;
  options.scene = SyntheticScene::kRoom;
  options.sensor = SyntheticSensor::kRgbd;
  options.width = 320;
  options.height = 240;
  options.rate_hz = 30;
  options.frames = 180;
  options.noise_sigma = 2;
  options.kinect_noise = true;
  options.shake_deg_per_s = 200;
  options.readout_s = kinect ? 0.025 : 0;
  options.depth_delay_s = kinect ? 0.015 : 0;
  return options;
}

struct Ran {
  std::string output, trajectory;
  nlohmann::json summary;
};

Ran RunUntold(const fs::path& room, int threads) {
  const fs::path out = testing::FreshFolder() / std::to_string(threads);
  const auto run = RunTutti({"run", "--config", (room / "config.yaml").string(), "--dataset", room.string(),
                             "--out", out.string(), "--no-loops", "--set", "camera.readout_s=0", "--set",
                             "camera.depth_delay_s=0", "--threads", std::to_string(threads)});
  EXPECT_EQ(run.status, 0) << run.output;
  return {run.output, ReadAll(out / "trajectory.txt"), nlohmann::json::parse(ReadAll(out / "summary.json"))};
}

TEST(MeasuredClocks, ARunBeginsAnewWithReadoutAndDelayOnceTheyAreSure) {
  const fs::path room = testing::GeneratedDataset(RoomInAHand(true));
  const Ran ran = RunUntold(room, 2);
  EXPECT_THAT(ran.output, HasSubstr("measured: the camera reads its rows in 2"));
  EXPECT_THAT(ran.output, HasSubstr("measured: depth is 1"));
  const nlohmann::json& clocks = ran.summary["clocks"];
  EXPECT_NEAR(clocks["readout_s"]["value"].get<double>(), 0.025, 0.004);
  EXPECT_NEAR(clocks["depth_delay_s"]["value"].get<double>(), 0.015, 0.004);
  EXPECT_TRUE(clocks["readout_s"]["used"].get<bool>());
  EXPECT_TRUE(clocks["depth_delay_s"]["used"].get<bool>());
  EXPECT_EQ(ran.summary["config"]["camera"]["readout_s"], clocks["readout_s"]["value"]);
  EXPECT_EQ(ran.summary["frames"]["total"], 180) << "those of the last beginning alone";
  EXPECT_LT(ran.summary["evaluation"]["slam"]["ate_rmse_m"].get<double>(), 0.015) << "0.1 without";
  EXPECT_EQ(RunUntold(room, 1).trajectory, ran.trajectory);
}

TEST(MeasuredClocks, AResumedRunStillSaysWhatWasMeasured) {
  const fs::path room = testing::GeneratedDataset(RoomInAHand(true));
  const std::string out = (testing::FreshFolder() / "out").string();
  // Interrupted in its second beginning.
  const auto broken =
      testing::RunTuttiAndSignal({"run", "--config", (room / "config.yaml").string(), "--dataset",
                                  room.string(), "--out", out, "--no-loops", "--checkpoint", "3600", "--set",
                                  "camera.readout_s=0", "--set", "camera.depth_delay_s=0"},
                                 "begins anew with that", SIGINT);
  EXPECT_EQ(broken.status, 130) << broken.output;
  const auto run = RunTutti({"run", "--resume", out});
  ASSERT_EQ(run.status, 0) << run.output;
  const auto summary = nlohmann::json::parse(ReadAll(fs::path(out) / "summary.json"));
  EXPECT_TRUE(summary["clocks"]["readout_s"]["used"].get<bool>());
  EXPECT_EQ(summary["config"]["camera"]["readout_s"], summary["clocks"]["readout_s"]["value"]);
}

TEST(MeasuredClocks, TheTimeOfAllBeginningsCounts) {
  RunRequest request;
  request.dataset = testing::GeneratedDataset(RoomInAHand(true));
  request.quiet = true;
  RunResult blank, result;
  blank.config = LoadConfig(request.dataset / "config.yaml");
  result = blank;
  result.wall_s = 3;
  result.cpu_s = 4;
  result.frames_lost = 5;
  ClocksFound found;
  found.readout_s = 0.02;
  found.readout_sigma_s = 5e-4;
  const auto dataset = BeginAnew(request, found, blank, result);
  EXPECT_EQ(result.wall_s, 3);
  EXPECT_EQ(result.cpu_s, 4);
  EXPECT_EQ(result.frames_lost, 0u);
  EXPECT_EQ(result.begun_anew, 1);
  EXPECT_NEAR(dataset->Rig().readout_s, 0.02, 1e-12);
  EXPECT_EQ(result.clocks_used->readout_s, 0.02);
}

TEST(MeasuredClocks, OfPerfectClocksNothingIsTaken) {
  const Ran ran = RunUntold(testing::GeneratedDataset(RoomInAHand(false)), 2);
  EXPECT_THAT(ran.output, Not(HasSubstr("measured")));
  EXPECT_NEAR(ran.summary["clocks"]["depth_delay_s"]["value"].get<double>(), 0, 0.002);
}

}  // namespace
}  // namespace tutti
