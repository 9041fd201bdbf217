// `tutti run` with two cameras, for which videos of the tiny town stand in.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <sstream>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;

constexpr int kTownPairs = 20;

class CameraPairRun : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!WriteVideos()) GTEST_SKIP() << "this OpenCV can't write a video without loss";
  }

  // The first `right` images of the right camera, and kTownPairs of the left one.
  bool WriteVideos(int right = kTownPairs) const {
    DatasetOptions options;
    options.sensor = Sensor::kStereo;
    const auto town = OpenDataset(testing::TinyTown(), options);
    const cv::Size size(town->Rig().camera.width, town->Rig().camera.height);
    const auto writer = [&](const char* name) {
      return cv::VideoWriter((folder_ / name).string(), cv::CAP_FFMPEG,
                             cv::VideoWriter::fourcc('F', 'F', 'V', '1'), 10, size, false);
    };
    cv::VideoWriter left_video = writer("left.mkv"), right_video = writer("right.mkv");
    if (!left_video.isOpened() || !right_video.isOpened()) return false;
    for (int i = 0; i < kTownPairs; ++i) {
      const ReadResult pair = town->Read(static_cast<std::size_t>(i));
      left_video.write(pair.frame->image);
      if (i < right) right_video.write(pair.frame->right);
    }
    return true;
  }
  // As Kalibr writes it.
  fs::path Camchain() const {
    DatasetOptions options;
    options.sensor = Sensor::kStereo;
    const CameraRig rig = OpenDataset(testing::TinyTown(), options)->Rig();
    std::ostringstream lens;
    lens << "  camera_model: pinhole\n  intrinsics: [" << rig.camera.fx << ", " << rig.camera.fy << ", "
         << rig.camera.cx << ", " << rig.camera.cy << "]\n  resolution: [" << rig.camera.width << ", "
         << rig.camera.height << "]\n";
    std::ostringstream chain;
    chain << "cam0:\n"
          << lens.str() << "cam1:\n  T_cn_cnm1:\n  - [1, 0, 0, " << -rig.baseline_m
          << "]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n"
          << lens.str();
    testing::WriteAll(folder_ / "camchain.yaml", chain.str());
    return folder_ / "camchain.yaml";
  }
  std::string Pair() const {
    return "camera:" + (folder_ / "left.mkv").string() + "," + (folder_ / "right.mkv").string();
  }
  testing::ProcessResult Run(const std::string& dataset, const std::string& out,
                             const std::vector<std::string>& more) const {
    std::vector<std::string> words{"run",         dataset,      "--out", (folder_ / out).string(),
                                   "--no-report", "--no-loops", "--end", std::to_string(kTownPairs)};
    words.insert(words.end(), more.begin(), more.end());
    return RunTutti(words);
  }
  nlohmann::json Summary(const std::string& out) const {
    return nlohmann::json::parse(ReadAll(folder_ / out / "summary.json"));
  }
  Trajectory Poses(const std::string& out) const {
    return ReadTrajectory(folder_ / out / "trajectory.txt", TrajectoryFormat::kTum);
  }

  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(CameraPairRun, GoesWhereTheFolderOfThePairsGoes) {
  ASSERT_EQ(Run(testing::TinyTown().string(), "folder", {}).status, 0);
  const auto live = Run(Pair(), "live", {"--sensor", "stereo", "--calibration", Camchain().string()});
  ASSERT_EQ(live.status, 0) << live.output;
  EXPECT_THAT(live.output, AllOf(HasSubstr("two cameras"), HasSubstr("camchain.yaml, Kalibr")));
  const Trajectory folder = Poses("folder"), pair = Poses("live");
  ASSERT_EQ(pair.size(), folder.size());
  for (std::size_t i = 0; i < pair.size(); ++i) {
    EXPECT_NEAR(pair[i].stamp_s, folder[i].stamp_s, 1e-6);
    EXPECT_NEAR((pair[i].pose.translation - folder[i].pose.translation).norm(), 0, 0.05) << i;
  }
  EXPECT_EQ(Summary("live")["frames"]["tracked"], kTownPairs);
  EXPECT_EQ(Summary("live")["frames"]["without_depth"], 0);
  EXPECT_EQ(Summary("live")["config"]["camera"]["right"]["T_right_left"].size(), 16U);
}

TEST_F(CameraPairRun, CountsTheFramesWithoutRightImage) {
  ASSERT_TRUE(WriteVideos(12));
  const auto run = Run(Pair(), "out", {"--sensor", "stereo", "--calibration", Camchain().string()});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("right.mkv ended after 12 images"));
  const nlohmann::json frames = Summary("out")["frames"];
  EXPECT_EQ(frames["total"], kTownPairs);
  EXPECT_EQ(frames["without_depth"], kTownPairs - 12);
  EXPECT_EQ(frames["bad_depth"][0]["index"], 12);
}

TEST_F(CameraPairRun, AsksWhatTheTwoCamerasAre) {
  const auto run = Run(Pair(), "out", {});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, AllOf(HasSubstr("--sensor stereo (LEFT,RIGHT)"), HasSubstr("--sensor rgbd")));
  const auto guessed = Run(Pair(), "out", {"--sensor", "stereo"});
  EXPECT_EQ(guessed.status, 1);
  EXPECT_THAT(guessed.output, HasSubstr("the distance of the two cameras is not known"));
}

}  // namespace
}  // namespace tutti
