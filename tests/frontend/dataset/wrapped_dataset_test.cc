// Cameras that were not upright.
#include "frontend/dataset/wrapped_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::FreshFolder, testing::OpenError, testing::Picture, testing::With, testing::WriteImage;
using ::testing::HasSubstr;

DatasetOptions Turned(int degrees, Sensor sensor = Sensor::kMono) {
  DatasetOptions options = With(sensor, true);
  options.camera->fy = 70;
  options.camera->cx = 20;
  options.rotate = degrees;
  return options;
}

fs::path ColourAndDepth() {
  fs::path folder = FreshFolder() / "room";
  cv::Mat depth = Picture(64, 48, 3, CV_16UC1);
  WriteImage(folder / "rgb/0.png", Picture(64, 48, 0));
  WriteImage(folder / "depth/0.png", depth);
  WriteImage(folder.parent_path() / "mask.png", Picture(64, 48, 5));
  testing::WriteText(folder / "rgb.txt", "0.0 rgb/0.png\n");
  testing::WriteText(folder / "depth.txt", "0.0 depth/0.png\n");
  return folder;
}

TEST(TurnedDataset, ShowsEachPointOfTheBodyAtTheTurnedPixelOfTheTurnedCamera) {
  const fs::path folder = ColourAndDepth();
  const auto stored = OpenDataset(folder, Turned(0, Sensor::kRgbd));
  const InputFrame before = *stored->Read(0).frame;
  const Eigen::Vector3d point(0.1, -0.2, 1.5);  // of the body
  const auto pixel_of = [&](const Dataset& dataset) {
    return dataset.Rig().camera.Project(dataset.Rig().T_body_camera.Inverse() * point);
  };
  const Eigen::Vector2d p = pixel_of(*stored);
  for (const int degrees : {90, 180, 270}) {
    DatasetOptions options = Turned(degrees, Sensor::kRgbd);
    options.mask = (folder.parent_path() / "mask.png").string();
    const auto turned = OpenDataset(folder, options);
    const InputFrame after = *turned->Read(0).frame;
    const cv::Size size = degrees == 180 ? cv::Size(64, 48) : cv::Size(48, 64);
    EXPECT_EQ(after.image.size(), size);
    EXPECT_EQ(after.depth_m.size(), size);
    EXPECT_EQ(after.mask.size(), size);
    EXPECT_EQ(turned->ReadColour(0).image.size(), size);
    EXPECT_EQ(turned->Rig().camera.width, size.width);
    EXPECT_EQ(turned->Rig().camera.height, size.height);
    const Eigen::Vector2d q = pixel_of(*turned);
    const Eigen::Vector2d expected = degrees == 90    ? Eigen::Vector2d(47 - p.y(), p.x())
                                     : degrees == 180 ? Eigen::Vector2d(63 - p.x(), 47 - p.y())
                                                      : Eigen::Vector2d(p.y(), 63 - p.x());
    EXPECT_NEAR((q - expected).norm(), 0, 1e-9) << degrees;
    // What is at a pixel went along.
    const cv::Point from(10, 5);
    const cv::Point to = degrees == 90    ? cv::Point(42, 10)
                         : degrees == 180 ? cv::Point(53, 42)
                                          : cv::Point(5, 53);
    EXPECT_EQ(after.image.at<std::uint8_t>(to), before.image.at<std::uint8_t>(from)) << degrees;
    EXPECT_EQ(after.depth_m.at<float>(to), before.depth_m.at<float>(from)) << degrees;
    EXPECT_EQ(after.mask.at<std::uint8_t>(to), Picture(64, 48, 5).at<std::uint8_t>(from)) << degrees;
  }
}

TEST(TurnedDataset, OfAFullTurnIsAsItWas) {
  const PinholeCamera camera = *Turned(0).camera;
  const PinholeCamera round = TurnedCamera(TurnedCamera(camera, 90), 270);
  EXPECT_EQ(round.fx, camera.fx);
  EXPECT_EQ(round.cx, camera.cx);
  EXPECT_EQ(round.cy, camera.cy);
  EXPECT_EQ(round.width, camera.width);
}

TEST(TurnedDataset, TurnsTheDistortionWithTheCamera) {
  PinholeCamera camera = *Turned(0).camera;
  const Eigen::Vector3d point(0.3, -0.2, 1.5);
  for (const Distortion distortion : {Distortion::kRadTan, Distortion::kEquidistant}) {
    camera.distortion = distortion;
    camera.coefficients = {-0.2, 0.05, 0.01, -0.02, 0};
    const Eigen::Vector2d p = camera.Project(point);
    // Points turn with the images: to the right becomes downwards.
    const Eigen::Vector2d q = TurnedCamera(camera, 90).Project({-point.y(), point.x(), point.z()});
    EXPECT_NEAR((q - Eigen::Vector2d(camera.height - 1 - p.y(), p.x())).norm(), 0, 1e-9);
    const Eigen::Vector2d r = TurnedCamera(camera, 180).Project({-point.x(), -point.y(), point.z()});
    EXPECT_NEAR((r - Eigen::Vector2d(camera.width - 1 - p.x(), camera.height - 1 - p.y())).norm(), 0, 1e-9);
  }
}

TEST(TurnedDataset, RefusesPairsRollingShuttersAndOtherAngles) {
  const fs::path folder = FreshFolder() / "drive";
  testing::MakeKitti(folder, 2, true);
  DatasetOptions pairs = Turned(180, Sensor::kStereo);
  pairs.baseline_m = 0.5;
  EXPECT_THAT(OpenError(folder, pairs), HasSubstr("stereo pairs can't be turned"));
  EXPECT_EQ(OpenError(folder, Turned(180)), "no error");
  DatasetOptions rolling = Turned(90);
  rolling.readout_s = 0.02;
  EXPECT_THAT(OpenError(folder, rolling), HasSubstr("rolling shutter"));
  EXPECT_THAT(OpenError(folder, Turned(45)), HasSubstr("rotate must be 0, 90, 180 or 270"));
  EXPECT_THAT(OpenError(folder, Turned(360)), HasSubstr("rotate"));
}

}  // namespace
}  // namespace tutti
