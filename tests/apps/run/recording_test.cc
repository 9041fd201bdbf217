// What a recording is, from its folder alone.
#include "apps/run/recording.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "tests/apps/tiny_town.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

void WriteImages(const fs::path& folder, int count = 3, cv::Size size = {64, 48}) {
  fs::create_directories(folder);
  for (int i = 0; i < count; ++i)
    cv::imwrite((folder / (std::to_string(i) + ".png")).string(), cv::Mat(size, CV_8UC1, cv::Scalar(80)));
}

fs::path TumFolder(const std::string& name, bool depth) {
  fs::path folder = testing::FreshFolder() / name;
  WriteImages(folder / "rgb");
  std::ofstream rgb(folder / "rgb.txt");
  for (int i = 0; i < 3; ++i) rgb << i << " rgb/" << i << ".png\n";
  if (!depth) return folder;
  WriteImages(folder / "depth");
  std::ofstream list(folder / "depth.txt");
  for (int i = 0; i < 3; ++i) list << i << " depth/" << i << ".png\n";
  return folder;
}

// A generated town as KITTI comes: without a configuration of tutti.
fs::path KittiTown() {
  fs::path folder = testing::CopyOfTinyTown(testing::FreshFolder() / "town");
  fs::remove(folder / "config.yaml");
  return folder;
}

std::string Refusal(const fs::path& dataset, const CameraRequest& camera) {
  return testing::ErrorOf([&] { Recognise(dataset, camera); });
}

// What the command line may say.
CameraRequest OfSensor(Sensor sensor) {
  CameraRequest request;
  request.sensor = sensor;
  return request;
}
CameraRequest WithCamera(const std::string& camera) {
  CameraRequest request;
  request.camera = camera;
  return request;
}
CameraRequest WithView(double view_deg) {
  CameraRequest request;
  request.view_deg = view_deg;
  return request;
}

TEST(Recording, OfKittiWithTwoCamerasIsStereoWithItsOwnCalibration) {
  const fs::path folder = KittiTown();
  const Recording town = Recognise(folder, {});
  EXPECT_EQ(town.config.dataset.type, DatasetType::kKitti);
  EXPECT_EQ(town.config.dataset.sensor, Sensor::kStereo);
  EXPECT_FALSE(town.config.dataset.camera);  // calib.txt has it
  EXPECT_FALSE(town.guessed_lens);
  ASSERT_EQ(town.findings.size(), 3u);
  EXPECT_THAT(town.findings[0], HasSubstr("KITTI (image_0, image_1)"));
  EXPECT_THAT(town.findings[1], HasSubstr("stereo; --sensor mono"));
  EXPECT_THAT(town.findings[2], HasSubstr("calib.txt"));
  const auto dataset = OpenDataset(folder, town.config.dataset);
  EXPECT_GT(dataset->Rig().baseline_m, 0.1);
  EXPECT_EQ(Recognise(folder, OfSensor(Sensor::kMono)).config.dataset.sensor, Sensor::kMono);
}

TEST(Recording, OfPairsWithoutACalibrationIsOneCameraWithAGuess) {
  const fs::path kitti = KittiTown(), pairs = kitti.parent_path() / "pairs";
  fs::remove(kitti / "calib.txt");
  for (const char* camera : {"cam0", "cam1"}) WriteImages(pairs / camera);
  for (const fs::path& folder : {kitti, pairs}) {
    const Recording found = Recognise(folder, {});
    EXPECT_TRUE(found.guessed_lens);
    EXPECT_EQ(found.config.dataset.sensor, Sensor::kMono);
    EXPECT_THAT(found.findings[1], HasSubstr("the right camera is not used"));
    EXPECT_THAT(found.findings[2], HasSubstr("guessed"));
    EXPECT_EQ(OpenDataset(folder, found.config.dataset)->Size(),
              folder == pairs ? 3u : std::size_t{testing::kTinyFrames});
    EXPECT_THAT(Refusal(folder, OfSensor(Sensor::kStereo)),
                HasSubstr("the distance of the two cameras is not known"));
  }
}

TEST(Recording, OfTumsFolderNamesHasThePublishedCamera) {
  const Recording known = Recognise(TumFolder("rgbd_dataset_freiburg1_desk", true), {});
  ASSERT_TRUE(known.config.dataset.camera);
  EXPECT_DOUBLE_EQ(known.config.dataset.camera->fx, 517.306408);
  EXPECT_FALSE(known.guessed_lens);
  const Recording other = Recognise(TumFolder("my_desk", true), {});
  ASSERT_TRUE(other.config.dataset.camera);
  EXPECT_TRUE(other.guessed_lens);
  EXPECT_EQ(other.config.dataset.camera->width, 64);
}

TEST(Recording, OfColourAndDepthInOneFolderIsRgbdInTheLayoutsUnit) {
  const fs::path folder = testing::FreshFolder();
  for (int i = 0; i < 3; ++i) {
    const std::string name = (folder / ("frame-00000" + std::to_string(i))).string();
    cv::imwrite(name + ".color.png", cv::Mat(48, 64, CV_8UC3, cv::Scalar(80, 90, 100)));
    cv::imwrite(name + ".depth.png", cv::Mat(48, 64, CV_16UC1, cv::Scalar(1500)));
  }
  const Recording scene = Recognise(folder, WithCamera("60,60,32,24"));
  EXPECT_EQ(scene.config.dataset.sensor, Sensor::kRgbd);
  EXPECT_THAT(scene.findings[0], HasSubstr("7-Scenes (frame-*.color, frame-*.depth)"));
  EXPECT_THAT(scene.findings[1], HasSubstr("RGB-D, 1000 units of depth a metre"));
  const auto dataset = OpenDataset(folder, scene.config.dataset);
  ASSERT_EQ(dataset->Size(), 3u);
  EXPECT_FLOAT_EQ(dataset->Read(0).frame->depth_m.at<float>(0, 0), 1.5F);
}

TEST(Recording, OfTumWithDepthIsRgbdAndSaysWhichUnitIsAssumed) {
  EXPECT_EQ(Recognise(TumFolder("a", true), {}).config.dataset.sensor, Sensor::kRgbd);
  EXPECT_EQ(Recognise(TumFolder("a", false), {}).config.dataset.sensor, Sensor::kMono);
  EXPECT_THAT(Recognise(TumFolder("a", true), {}).findings[1],
              AllOf(HasSubstr("5000 units of depth a metre assumed"), HasSubstr("depth_units_per_m=1000")));
  EXPECT_THAT(Recognise(TumFolder("rgbd_dataset_freiburg1_desk", true), {}).findings[1],
              Not(HasSubstr("assumed")));
  CameraRequest camera;
  camera.depth_units_per_m = 1000;
  EXPECT_THAT(Recognise(TumFolder("a", true), camera).findings[1],
              HasSubstr("1000 units of depth a metre ("));
}

TEST(Recording, OfTartanAirIsStereoWithThePublishedCamera) {
  const fs::path folder = testing::FreshFolder();
  WriteImages(folder / "image_left", 3, {640, 480});
  WriteImages(folder / "image_right", 3, {640, 480});
  std::ofstream(folder / "pose_left.txt") << "0 0 0 0 0 0 1\n1 0 0 0 0 0 1\n2 0 0 0 0 0 1\n";
  const Recording air = Recognise(folder, {});
  EXPECT_EQ(air.config.dataset.sensor, Sensor::kStereo);
  EXPECT_FALSE(air.guessed_lens);
  EXPECT_THAT(air.findings[2], HasSubstr("published for TartanAir"));
  EXPECT_EQ(OpenDataset(folder, air.config.dataset)->Rig().baseline_m, 0.25);
}

TEST(Recording, OfImagesTakesAFieldOfViewOrTheCalibrationBesideThem) {
  const fs::path folder = testing::FreshFolder();
  WriteImages(folder);
  EXPECT_TRUE(Recognise(folder, {}).guessed_lens);
  const auto given = Recognise(folder, WithView(90)).config.dataset.camera;
  EXPECT_NEAR(given->fx, 32, 1e-9);
  EXPECT_NEAR(given->cx, 31.5, 1e-9);
  std::ofstream(folder / "calibration.yaml")
      << "Camera.fx: 60\nCamera.fy: 60\nCamera.cx: 32\nCamera.cy: 24\n";
  const Recording known = Recognise(folder, {});
  EXPECT_FALSE(known.guessed_lens);
  EXPECT_EQ(known.config.dataset.camera->fx, 60);
  EXPECT_EQ(known.config.dataset.camera->width, 64);
  EXPECT_THAT(known.findings[2], HasSubstr("calibration.yaml, ORB-SLAM"));
}

TEST(Recording, WithAConfigurationInItsFolderIsReadAsThatSays) {
  const fs::path folder = TumFolder("a", true);
  std::ofstream(folder / "config.yaml") << "camera_model: theirs\n";
  EXPECT_TRUE(Recognise(folder, {}).guessed_lens);
  std::ofstream(folder / "config.yaml")
      << "dataset:\n  type: tum\n  sensor: rgbd\n  max_depth_m: 3\ncamera:\n"
         "  width: 64\n  height: 48\n  fx: 50\n  fy: 50\n  cx: 31\n  cy: 23\n";
  const Recording own = Recognise(folder, {});
  EXPECT_FALSE(own.guessed_lens);
  EXPECT_EQ(own.config.dataset.max_depth_m, 3);
  EXPECT_THAT(own.findings[0], HasSubstr("config.yaml"));
}

TEST(Recording, TakesTheCameraOfTheCommandLineFirst) {
  const fs::path town = KittiTown();
  const auto given = Recognise(town, WithCamera("70,71,30,20")).config.dataset.camera;
  ASSERT_TRUE(given);
  EXPECT_EQ(given->fy, 71);
  EXPECT_EQ(given->distortion, Distortion::kNone);
  EXPECT_EQ(Recognise(town, WithCamera("70,71,30,20,0.1,0.2,0,0")).config.dataset.camera->distortion,
            Distortion::kRadTan);
}

TEST(Recording, OfAStreamIsNotLookedForAmongFiles) {
  EXPECT_THAT(Refusal("rtsp://127.0.0.1:1/front", WithCamera("70,71,30,20")),
              HasSubstr("no stream of video can be opened"));
}

TEST(Recording, OfOneCameraWithSensorStereoHasBothImagesSideBySide) {
  const fs::path file = testing::FreshFolder() / "both.avi";
  cv::VideoWriter writer(file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, cv::Size(128, 48));
  if (!writer.isOpened()) GTEST_SKIP() << "this OpenCV can't write a video";
  writer.write(cv::Mat(48, 128, CV_8UC3, cv::Scalar::all(80)));
  writer.release();
  CameraRequest camera = WithView(90);
  camera.sensor = Sensor::kStereo;
  const Recording found = Recognise("camera:" + file.string(), camera);
  EXPECT_EQ(found.config.dataset.camera->width, 64) << "of one of the two images";
  EXPECT_NEAR(found.config.dataset.camera->fx, 32, 1e-9);
  EXPECT_THAT(found.findings[0], HasSubstr("a camera, left and right side by side"));
  EXPECT_THAT(found.findings[1], Not(HasSubstr("--sensor mono")));
}

// It would wait here for ever: nobody sends anything.
TEST(Recording, OfAPipeIsNotOpenedBeforeTheRun) {
  const fs::path pipe = testing::FreshFolder() / "pipe";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const Recording found = Recognise(pipe, {});
  EXPECT_THAT(found.findings[0], HasSubstr("a video through a pipe"));
  EXPECT_TRUE(found.guessed_lens);
  EXPECT_FALSE(found.config.dataset.camera);
  EXPECT_EQ(found.config.dataset.fov_deg, 67);
  EXPECT_EQ(Recognise("camera:" + pipe.string(), WithCamera("70,71,30,20")).config.dataset.camera->fy, 71);
}

TEST(Recording, RefusesACameraThatCantBe) {
  const fs::path town = KittiTown();
  for (const auto& [text, why] : {std::pair("70,71,30", "--camera: has 3 numbers"),
                                  {"70,x,30,20", "'x' is no number"},
                                  {"70,71,-30,20", "principal point"}})
    EXPECT_THAT(Refusal(town, WithCamera(text)), HasSubstr(why));
  CameraRequest camera = WithCamera("70,71,30,20");
  camera.view_deg = 60;
  EXPECT_THAT(Refusal(town, camera), HasSubstr("give one of them"));
  EXPECT_THAT(Refusal("/nowhere", {}), HasSubstr("does not exist"));
  EXPECT_THAT(Refusal("camera:0,1", {}), HasSubstr("what are the two cameras?"));
}

}  // namespace
}  // namespace tutti
