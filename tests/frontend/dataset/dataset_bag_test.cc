// Bags of ROS as data sets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/bag_writer.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Difference, testing::FrameOf, testing::FreshFolder, testing::ImageMessage, testing::OpenError,
    testing::Picture, testing::With;
using ::testing::HasSubstr;

const fs::path& FourFrames() {
  static const fs::path file = [] {
    const std::string type = "sensor_msgs/Image";
    testing::BagWriter bag;
    for (int i = 0; i < 4; ++i) {
      const double stamp = 100 + 0.1 * i;
      const cv::Mat colour(48, 64, CV_8UC3, cv::Scalar(0, 0, 200));  // rgb8: blue
      bag.Write("/colour/image_raw", type, ImageMessage(colour, "rgb8", stamp));
      bag.Write("/grey/image", type, ImageMessage(Picture(64, 48, i, CV_16UC1), "mono16", stamp));
      if (i != 2) {
        const cv::Mat depth(48, 64, CV_16UC1, cv::Scalar(1500));
        bag.Write("/depth/image", type, ImageMessage(depth, "16UC1", stamp + 0.004));
      }
      bag.Write("/colour/camera_info", "sensor_msgs/CameraInfo",
                testing::CameraInfoMessage({64, 48}, {60, 0, 32, 0, 60, 24, 0, 0, 1}, "plumb_bob", {}));
    }
    bag.Write("/grey/image", type, ImageMessage(Picture(64, 48, 9, CV_16UC1), "mono16", 100.3));  // again
    return testing::FreshFile("test.bag", bag.Finish());
  }();
  return file;
}

DatasetOptions Topic(const std::string& topic, Sensor sensor = Sensor::kMono) {
  DatasetOptions options = With(sensor);
  options.topic = topic;
  return options;
}

TEST(BagDataset, ColourWithStampsOfTheHeadersAndTheCameraInfo) {
  const auto dataset = OpenDataset(FourFrames(), Topic("/colour/image_raw"));
  ASSERT_EQ(dataset->Size(), 4u);
  EXPECT_NEAR(dataset->Stamp(3), 100.3, 1e-6);
  EXPECT_TRUE(dataset->Rig().calibrated);
  EXPECT_DOUBLE_EQ(dataset->Rig().camera.fx, 60);
  EXPECT_NEAR(dataset->Rig().rate_hz, 10, 1e-3);
  const InputFrame read = FrameOf(*dataset, 1);
  EXPECT_EQ(read.image.type(), CV_8UC1);
  EXPECT_NEAR(read.image.at<unsigned char>(10, 10), 0.114 * 200, 1);
  const ColourImage colour = dataset->ReadColour(1);
  ASSERT_EQ(colour.image.type(), CV_8UC3) << colour.error;
  EXPECT_EQ(colour.image.at<cv::Vec3b>(10, 10), cv::Vec3b(200, 0, 0));
  EXPECT_THAT(dataset->ReadColour(4).error, HasSubstr("frame 4"));
}

TEST(BagDataset, SixteenBitIsScaledAndRepeatedStampsAreSkipped) {
  const auto dataset = OpenDataset(FourFrames(), Topic("/grey/image"));
  ASSERT_EQ(dataset->Size(), 4u);
  EXPECT_FALSE(dataset->Rig().calibrated);
  EXPECT_THAT(dataset->Warnings().front(), HasSubstr("repeat a time stamp"));
  const InputFrame read = FrameOf(*dataset, 2);
  EXPECT_EQ(Difference(read.image, Picture(64, 48, 2)), 0);
}

TEST(BagDataset, DepthInItsUnitAndImagesWithoutComeAlone) {
  DatasetOptions options = Topic("/colour/image_raw", Sensor::kRgbd);
  options.depth_topic = "/depth/image";
  const auto dataset = OpenDataset(FourFrames(), options);
  ASSERT_EQ(dataset->Size(), 4u);
  EXPECT_THAT(dataset->Warnings().front(), HasSubstr("1 of 4 images of /colour/image_raw have no depth"));
  ASSERT_TRUE(dataset->Read(2).frame.has_value());
  EXPECT_TRUE(dataset->Read(2).frame->depth_m.empty());
  const InputFrame read = FrameOf(*dataset, 3);
  EXPECT_EQ(read.index, 3);
  EXPECT_FLOAT_EQ(read.depth_m.at<float>(5, 5), 1.5F);
}

TEST(BagDataset, TopicsThatAreMissingAreListed) {
  EXPECT_THAT(OpenError(FourFrames(), With(Sensor::kMono)),
              HasSubstr("/colour/image_raw /depth/image /grey/image"));
  EXPECT_THAT(OpenError(FourFrames(), Topic("/left")), HasSubstr("has no images of '/left'"));
  EXPECT_THAT(OpenError(FourFrames(), Topic("/grey/image", Sensor::kStereo)), HasSubstr("right_topic"));
}

TEST(BagDataset, StereoPairsAreTakenAsTheyAreOrRectifiedWithTheRightCamera) {
  testing::BagWriter bag(testing::BagPacking::kLz4);
  for (int i = 0; i < 2; ++i) {
    bag.Write("/left", "sensor_msgs/Image", ImageMessage(Picture(64, 48, i), "mono8", 100 + i));
    bag.Write("/right", "sensor_msgs/Image", ImageMessage(Picture(64, 48, 50 + i), "mono8", 100 + i));
  }
  const fs::path file = testing::FreshFile("pairs.bag", bag.Finish());
  DatasetOptions options = Topic("/left", Sensor::kStereo);
  options.right_topic = "/right";
  options.camera = testing::SmallCamera();
  EXPECT_THAT(OpenError(file, options), HasSubstr("camera.baseline_m"));
  options.baseline_m = 0.5;
  EXPECT_EQ(Difference(OpenDataset(file, options)->Read(1).frame->right, Picture(64, 48, 51)), 0);
  options.baseline_m = 0;
  options.camera->distortion = Distortion::kRadTan;
  options.camera->coefficients = {-0.1, 0, 0, 0, 0};
  EXPECT_THAT(OpenError(file, options), HasSubstr("camera.right"));
  options.right = options.camera;
  options.T_right_left = {1, 0, 0, -0.2, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const auto raw = OpenDataset(file, options);
  EXPECT_NEAR(raw->Rig().baseline_m, 0.2, 1e-9);
  EXPECT_GT(Difference(raw->Read(1).frame->right, Picture(64, 48, 51)), 0);
}

// Two frames of 64x48 px of two cameras, with what their camera_infos say.
fs::path PairsWithInfo(const std::string& images, const CameraInfo& left, const CameraInfo& right) {
  testing::BagWriter bag(testing::BagPacking::kLz4);
  for (int i = 0; i < 2; ++i) {
    for (const auto& [name, info] : {std::pair("/left/", left), std::pair("/right/", right)}) {
      bag.Write(name + images, "sensor_msgs/Image", ImageMessage(Picture(64, 48, i), "mono8", 100 + i));
      bag.Write(name + std::string("camera_info"), "sensor_msgs/CameraInfo",
                testing::CameraInfoMessage(info));
    }
  }
  return testing::FreshFile("pairs.bag", bag.Finish());
}

CameraInfo SmallInfo(double baseline_m) {
  CameraInfo info;
  info.width = 64;
  info.height = 48;
  info.model = "plumb_bob";
  info.lens = {-0.1, 0, 0, 0, 0};
  info.K = {60, 0, 31, 0, 60, 23, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {50, 0, 30, -50 * baseline_m, 0, 50, 22, 0, 0, 0, 1, 0};
  return info;
}

TEST(BagDataset, PairsHaveTheirCamerasFromBothCameraInfos) {
  const auto options = [](const std::string& images) {
    DatasetOptions o = Topic("/left/" + images, Sensor::kStereo);
    o.right_topic = "/right/" + images;
    return o;
  };
  const auto raw =
      OpenDataset(PairsWithInfo("image_raw", SmallInfo(0), SmallInfo(0.2)), options("image_raw"));
  EXPECT_NEAR(raw->Rig().baseline_m, 0.2, 1e-9);
  EXPECT_GT(Difference(raw->Read(1).frame->right, Picture(64, 48, 1)), 0) << "rectified";
  const fs::path rectified = PairsWithInfo("image_rect", SmallInfo(0), SmallInfo(0.2));
  const auto pairs = OpenDataset(rectified, options("image_rect"));
  EXPECT_NEAR(pairs->Rig().baseline_m, 0.2, 1e-9);
  EXPECT_EQ(pairs->Rig().camera.fx, 50) << "P, not K";
  EXPECT_EQ(Difference(pairs->Read(1).frame->image, Picture(64, 48, 1)), 0);
  EXPECT_THAT(pairs->Warnings().front(), HasSubstr("/left/camera_info, P, as the images are rectified"));
  EXPECT_THAT(OpenError(PairsWithInfo("image_raw", SmallInfo(0.2), SmallInfo(0)), options("image_raw")),
              HasSubstr("/right/image_raw is the left camera"));
}

TEST(BagDataset, BinningAndRegionOfCameraInfoAreApplied) {
  CameraInfo info = SmallInfo(0);
  info.lens.clear();
  info.width = 200;
  info.height = 120;
  info.K = {120, 0, 99.5, 0, 120, 59.5, 0, 0, 1};
  info.window = {2, 2, 40, 10, 128, 96};
  const auto dataset = OpenDataset(PairsWithInfo("image_raw", info, info), Topic("/left/image_raw"));
  EXPECT_EQ(dataset->Rig().camera.fx, 60);
  EXPECT_EQ(dataset->Rig().camera.cx, 29.5);  // (99.5 - 40 + 0.5) / 2 - 0.5
  EXPECT_EQ(dataset->Rig().camera.cy, 24.5);
  EXPECT_THAT(dataset->Warnings().front(), HasSubstr("binning 2x2, region 128x96 at (40, 10) applied"));
  info.width = 64;  // of a driver that states what it sends
  info.height = 48;
  info.K = {60, 0, 31, 0, 60, 23, 0, 0, 1};
  const auto sent = OpenDataset(PairsWithInfo("image_raw", info, info), Topic("/left/image_raw"));
  EXPECT_EQ(sent->Rig().camera.fx, 60);
  EXPECT_THAT(sent->Warnings().front(), HasSubstr("in it already"));
}

// A bag with images of these stamps in their headers, recorded every quarter of a second from 50 s on.
fs::path WithStamps(const std::vector<double>& stamps_s) {
  testing::BagWriter bag;
  for (std::size_t i = 0; i < stamps_s.size(); ++i) {
    const double received_s = 50 + 0.25 * static_cast<double>(i);
    const cv::Mat picture = Picture(64, 48, static_cast<int>(i)), depth(48, 64, CV_16UC1, cv::Scalar(1500));
    bag.Write("/image", "sensor_msgs/Image", ImageMessage(picture, "mono8", stamps_s[i]), received_s);
    bag.Write("/depth", "sensor_msgs/Image", ImageMessage(depth, "16UC1", 9 + 0.1 * static_cast<double>(i)),
              received_s + 0.01);
  }
  return testing::FreshFile("stamps.bag", bag.Finish());
}

TEST(BagDataset, StampsThatJumpBackAreRefusedWithThePlace) {
  EXPECT_THAT(OpenError(WithStamps({10, 11, 12, 10.5, 11.5}), Topic("/image")),
              AllOf(HasSubstr("/image: its time stamps jump back at image 3"),
                    HasSubstr("from 12.000000 s to 10.500000 s"), HasSubstr("cut it there")));
}

TEST(BagDataset, WithConstantStampsHasTheTimesAtWhichItWasRecorded) {
  DatasetOptions options = Topic("/image", Sensor::kRgbd);
  options.depth_topic = "/depth";
  for (const double stamp : {0.0, 77.5}) {
    const auto dataset = OpenDataset(WithStamps({stamp, stamp, stamp}), options);
    ASSERT_EQ(dataset->Size(), 3u);
    EXPECT_DOUBLE_EQ(dataset->Stamp(2), 50.5);
    EXPECT_THAT(dataset->Warnings().front(),
                AllOf(HasSubstr("/image have the same stamp"), HasSubstr("recorded are used")));
    EXPECT_FALSE(dataset->Read(1).frame->depth_m.empty());  // paired by the same clock
  }
  EXPECT_DOUBLE_EQ(OpenDataset(WithStamps({5}), Topic("/image"))->Stamp(0), 5);
}

TEST(BagDataset, OneThatWasCutOffGivesTheFramesBefore) {
  const fs::path file = FreshFolder() / "cut.bag";
  fs::copy_file(FourFrames(), file);
  testing::Truncate(file, 0.5);
  const auto dataset = OpenDataset(file, Topic("/grey/image"));
  EXPECT_EQ(dataset->Size(), 2u);
  EXPECT_THAT(dataset->Warnings().front(), AllOf(HasSubstr("cut.bag: "), HasSubstr("cut off")));
  testing::WriteText(file, "no bag at all");
  EXPECT_THAT(OpenError(file, Topic("/grey/image")), HasSubstr("can't be read as a ROS bag"));
}

TEST(BagDataset, ImagesOfADamagedChunkAreSkippedAndCounted) {
  testing::BagWriter bag(testing::BagPacking::kLz4);
  for (int i = 0; i < 4; ++i)
    bag.Write("/image", "sensor_msgs/Image", ImageMessage(Picture(64, 48, i), "mono8", 100 + i));
  std::string bytes = bag.Finish();
  std::size_t chunk = 0;
  for (int i = 0; i < 2; ++i) chunk = bytes.find("compression=lz4", chunk + 1);
  ASSERT_NE(chunk, std::string::npos);
  for (std::size_t i = 60; i < 160; ++i) bytes[chunk + i] = '\xff';
  const auto dataset = OpenDataset(testing::FreshFile("damaged.bag", bytes), Topic("/image"));
  ASSERT_EQ(dataset->Size(), 3u);
  EXPECT_DOUBLE_EQ(dataset->Stamp(1), 102);
  EXPECT_THAT(dataset->Warnings().front(), HasSubstr("1 of 4 images of /image can't be read"));
  EXPECT_TRUE(dataset->Read(1).frame.has_value());
}

TEST(BagDataset, TheMaskIsOfEveryFrame) {
  DatasetOptions options = Topic("/grey/image");
  cv::Mat mask(48, 64, CV_8UC1, cv::Scalar(255));
  mask.rowRange(40, 48).setTo(0);
  options.mask = FreshFolder() / "mask.png";
  testing::WriteImage(options.mask, mask);
  const InputFrame read = FrameOf(*OpenDataset(FourFrames(), options), 1);
  EXPECT_EQ(cv::countNonZero(read.mask != mask), 0);
}

TEST(BagDataset, OfRos2ByItsFileAndByItsFolder) {
  const fs::path folder = FreshFolder() / "recording";
  fs::create_directories(folder);
  fs::copy_file(testing::SourceDir() / "tests/frontend/dataset/bags/zstd.mcap", folder / "recording_0.mcap");
  for (const fs::path& path : {folder, folder / "recording_0.mcap"}) {
    EXPECT_EQ(DetectDatasetType(path), DatasetType::kBag);
    const auto dataset = OpenDataset(path, Topic("/left/image"));
    ASSERT_EQ(dataset->Size(), 3u);
    EXPECT_DOUBLE_EQ(dataset->Stamp(2), 102.5);
    EXPECT_TRUE(dataset->Rig().calibrated);
    EXPECT_TRUE(dataset->Read(1).frame.has_value()) << dataset->Read(1).error;
  }
  DatasetOptions stereo = Topic("/left/image", Sensor::kStereo);
  stereo.right_topic = "/right/image/compressed";
  stereo.camera = Pinhole(60, 60, 8, 6, {16, 12});
  stereo.baseline_m = 0.5;
  const auto pairs = OpenDataset(folder, stereo);
  EXPECT_EQ(Difference(pairs->Read(0).frame->right, Picture(16, 12, 1)), 0);
  DatasetOptions images = Topic("/left/image");
  images.type = DatasetType::kImages;
  EXPECT_THAT(OpenError(folder, images), HasSubstr("holds bags of ROS 2"));
  images.type = DatasetType::kVideo;
  EXPECT_THAT(OpenError(folder, images), HasSubstr("give the file"));
}

}  // namespace
}  // namespace tutti
