// `tutti run` on two cameras, on videos and pipes, with a part of the images, and with images that are not
// upright.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <sstream>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/matroska_writer.h"
#include "tests/support/pipe_sender.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
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
  // The two cameras in a file of Kalibr.
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
    return RunTutti({"run", dataset, "--out", folder_ / out, "--no-report", "--no-loops", "--end",
                     std::to_string(kTownPairs)},
                    more);
  }
  nlohmann::json Summary(const std::string& out) const {
    return testing::ReadJson(folder_ / out / "summary.json");
  }
  Trajectory Poses(const std::string& out) const {
    return ReadTrajectory(folder_ / out / "trajectory.txt", TrajectoryFormat::kTum);
  }

  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(CameraPairRun, GoesWhereTheFolderOfThePairsGoes) {
  ASSERT_EQ(Run(testing::TinyTown().string(), "folder", {}).status, 0);
  const auto live = Run(Pair(), "live", {"--sensor", "stereo", "--calibration", Camchain()});
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
  EXPECT_THAT(Done(Run(Pair(), "out", {"--sensor", "stereo", "--calibration", Camchain()})),
              HasSubstr("right.mkv ended after 12 images"));
  const nlohmann::json frames = Summary("out")["frames"];
  EXPECT_EQ(frames["total"], kTownPairs);
  EXPECT_EQ(frames["without_depth"], kTownPairs - 12);
  EXPECT_EQ(frames["bad_depth"][0]["index"], 12);
}

TEST_F(CameraPairRun, AsksWhatTheTwoCamerasAre) {
  ExpectRefusal(Run(Pair(), "out", {}), {"--sensor stereo (LEFT,RIGHT)", "--sensor rgbd"});
  ExpectRefusal(Run(Pair(), "out", {"--sensor", "stereo"}), {"the distance of the two cameras is not known"});
}

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
    return RunTutti({"run", video, "--camera", camera_, "--no-report", "--no-map", "--out", folder_ / out});
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
  Done(Run(video_, "file"));
  ExpectStampsOfTheVideo("file");
  const fs::path pipe = folder_ / "pipe";
  const testing::PipeSender sender(pipe, testing::ReadAll(video_));
  EXPECT_THAT(Done(Run(pipe, "pipe_out")), HasSubstr("a video through a pipe"));
  ExpectStampsOfTheVideo("pipe_out");
}

TEST_F(VideoOfTheTown, IsClosedByTheTimesOfItsContainer) {
  Trajectory poses = ReadTrajectory(testing::TinyTown() / "poses.txt", TrajectoryFormat::kKitti);
  ASSERT_EQ(poses.size(), stamps_s_.size());
  for (std::size_t i = 0; i < poses.size(); ++i) poses[i].stamp_s = stamps_s_[i];
  poses.erase(poses.begin() + 5);  // not one for each frame
  WriteTrajectory(folder_ / "odometry.txt", poses, TrajectoryFormat::kTum);
  const auto closed = RunTutti({"close", "--trajectory", folder_ / "odometry.txt", "--images", video_,
                                "--camera", camera_, "--no-report", "--out", folder_ / "closed"});
  EXPECT_EQ(closed.status, 0) << closed.output;
  EXPECT_THAT(closed.output, HasSubstr("the frames have the time stamps of the video"));
  const auto summary = testing::ReadJson(folder_ / "closed" / "summary.json");
  EXPECT_EQ(summary["frames"]["tracked"], stamps_s_.size());
}

TEST_F(VideoOfTheTown, ThroughAPipeIsRefusedWhereAllFramesAreNeeded) {
  const fs::path pipe = folder_ / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& name : {pipe.string(), std::string("-")}) {
    ExpectRefusal(RunTutti({"loops", name, "--out", folder_ / "out"}), {name + ": gives its frames once"});
  }
}

TEST(EveryCommandThatTakesImages, TakesACamera) {
  for (const char* name : {"run", "close", "localize", "compare", "calibrate-check", "loops"})
    EXPECT_THAT(RunTutti({name, "--help"}).output, HasSubstr("--camera")) << name;
  const auto checked =
      RunTutti({"calibrate-check", (testing::TinyTown() / "image_0").string(), "--camera", "333,334,100,50"});
  EXPECT_THAT(checked.output, HasSubstr("fx 333.00, fy 334.00"));
}

constexpr int kHidden = 90;  // rows of 240

// A town whose lowest rows show the same in every image.
class ImageUse : public ::testing::Test {
 protected:
  fs::path Painted() const {
    fs::path town = testing::CopyOfTinyTown(folder_ / "painted");
    cv::RNG random(7);
    cv::Mat pattern(kHidden / 3, 160, CV_8UC1), large;
    random.fill(pattern, cv::RNG::UNIFORM, 0, 256);
    cv::repeat(pattern, 3, 3, large);
    for (const char* camera : {"image_0", "image_1"}) {
      for (const auto& entry : fs::directory_iterator(town / camera)) {
        cv::Mat image = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
        large.copyTo(image.rowRange(image.rows - kHidden, image.rows));
        cv::imwrite(entry.path().string(), image);
      }
    }
    return town;
  }
  fs::path Mask() const {
    cv::Mat mask(240, 480, CV_8UC1, cv::Scalar(255));
    mask.rowRange(240 - kHidden, 240).setTo(0);
    cv::imwrite((folder_ / "mask.png").string(), mask);
    return folder_ / "mask.png";
  }
  testing::ProcessResult Run(const fs::path& town, const std::string& out,
                             const std::vector<std::string>& more) const {
    return RunTutti({"run", town, "--out", folder_ / out, "--no-report"}, more);
  }
  nlohmann::json Summary(const std::string& out) const {
    return testing::ReadJson(folder_ / out / "summary.json");
  }
  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(ImageUse, WhatTheMaskHidesDoesNotStopTheCamera) {
  const fs::path town = Painted();
  const auto masked = Run(town, "masked", {"--mask", Mask()});
  ASSERT_EQ(masked.status, 0) << masked.output;
  EXPECT_EQ(Summary("masked")["frames"]["tracked"], testing::kTinyFrames);
  EXPECT_EQ(Summary("masked")["frames"]["without_mask"], 0);
  EXPECT_LT(Summary("masked")["evaluation"]["slam"]["ate_rmse_m"].get<double>(), 0.3);
  EXPECT_EQ(Summary("masked")["config"]["dataset"]["mask"], (folder_ / "mask.png").string());
}

TEST_F(ImageUse, ImagesWithoutAMaskAreUsedWholeAndCounted) {
  fs::create_directories(folder_ / "masks");
  fs::copy(Mask(), folder_ / "masks" / "000002.png");
  fs::copy(Mask(), folder_ / "masks" / "000003.png");
  const std::string run = Done(Run(testing::TinyTown(), "out", {"--mask", folder_ / "masks", "--end", "10"}));
  EXPECT_EQ(Summary("out")["frames"]["without_mask"], 8);
  EXPECT_THAT(run, HasSubstr("28 of 30 images have no mask"));
  EXPECT_THAT(run, HasSubstr("8 without mask"));
}

TEST_F(ImageUse, AMaskThatCantBeIsToldBeforeTheRun) {
  cv::imwrite((folder_ / "small.png").string(), cv::Mat(10, 10, CV_8UC1, cv::Scalar(255)));
  ExpectRefusal(Run(testing::TinyTown(), "out", {"--mask", folder_ / "small.png"}),
                {"small.png: the mask has 10x10 pixels, but the images have 480x240"});
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(ImageUse, ImagesThatLieOnTheirSideAreTurnedUpright) {
  const fs::path lying = testing::CopyOfTinyTown(folder_ / "lying");
  for (const auto& entry : fs::directory_iterator(lying / "image_0")) {
    cv::Mat image = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    cv::rotate(image, image, cv::ROTATE_90_COUNTERCLOCKWISE);
    cv::imwrite(entry.path().string(), image);
  }
  const std::vector<std::string> upright{"--sensor",   "mono",  "--camera", "240,240,230,120",
                                         "--no-loops", "--end", "15"};
  const std::vector<std::string> turned{
      "--sensor", "mono", "--camera", "240,240,120,249", "--no-loops", "--end", "15", "--rotate", "90"};
  const auto a = Run(testing::TinyTown(), "a", upright), b = Run(lying, "b", turned);
  ASSERT_EQ(a.status, 0) << a.output;
  ASSERT_EQ(b.status, 0) << b.output;
  const Trajectory first = ReadTrajectory(folder_ / "a" / "trajectory.txt", TrajectoryFormat::kTum);
  const Trajectory second = ReadTrajectory(folder_ / "b" / "trajectory.txt", TrajectoryFormat::kTum);
  ASSERT_EQ(first.size(), second.size());
  ASSERT_GT(first.size(), 5u);
  const double turn = 0.5 * 3.14159265358979323846;
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_NEAR((first[i].pose.translation - second[i].pose.translation).norm(), 0, 1e-5);
    // The body is the camera as it lay.
    EXPECT_NEAR(first[i].pose.rotation.angularDistance(second[i].pose.rotation), turn, 1e-5);
  }
  EXPECT_EQ(Summary("b")["config"]["dataset"]["rotate"], 90);
}

TEST_F(ImageUse, PairsAreNotTurned) {
  ExpectRefusal(Run(testing::TinyTown(), "out", {"--rotate", "90"}), {"stereo pairs can't be turned"});
  ExpectRefusal(Run(testing::TinyTown(), "out", {"--rotate", "45"}), {"90, 180, 270"});
}

}  // namespace
}  // namespace tutti
