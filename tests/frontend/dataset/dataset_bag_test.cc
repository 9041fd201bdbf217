// ROS 1 bags; without librosbag, that it is said.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <string>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"

#ifdef TUTTI_HAVE_ROSBAG
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#endif

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::FreshFolder;
using ::testing::HasSubstr;
using testing::OpenError;
using testing::With;

#ifndef TUTTI_HAVE_ROSBAG

TEST(BagDataset, WithoutLibrosbagItIsSaidWhatToInstall) {
  const fs::path file = FreshFolder() / "x.bag";
  testing::WriteText(file, "#ROSBAG V2.0");
  EXPECT_THAT(OpenError(file, With(Sensor::kMono)), HasSubstr("librosbag-storage-dev"));
}

#else

using testing::Picture;

sensor_msgs::Image Message(const cv::Mat& image, const std::string& encoding, double stamp_s) {
  sensor_msgs::Image message;
  message.header.stamp = ros::Time(stamp_s);
  message.width = static_cast<std::uint32_t>(image.cols);
  message.height = static_cast<std::uint32_t>(image.rows);
  message.step = static_cast<std::uint32_t>(image.step);
  message.encoding = encoding;
  message.data.assign(image.datastart, image.dataend);
  return message;
}

const fs::path& Bag() {
  static const fs::path file = [] {
    fs::path path = FreshFolder() / "test.bag";
    rosbag::Bag bag(path.string(), rosbag::bagmode::Write);
    for (int i = 0; i < 4; ++i) {
      const double stamp = 100 + 0.1 * i;
      const ros::Time received(200 + 0.1 * i);
      cv::Mat colour(48, 64, CV_8UC3, cv::Scalar(0, 0, 200));  // rgb8: blue
      bag.write("/colour/image_raw", received, Message(colour, "rgb8", stamp));
      bag.write("/grey/image", received, Message(Picture(64, 48, i, CV_16UC1), "mono16", stamp));
      if (i != 2) {
        const cv::Mat depth(48, 64, CV_16UC1, cv::Scalar(1500));
        bag.write("/depth/image", received, Message(depth, "16UC1", stamp + 0.004));
      }
      sensor_msgs::CameraInfo info;
      info.width = 64;
      info.height = 48;
      info.K = {60, 0, 32, 0, 60, 24, 0, 0, 1};
      info.distortion_model = "plumb_bob";
      bag.write("/colour/camera_info", received, info);
    }
    bag.write("/grey/image", ros::Time(201),
              Message(Picture(64, 48, 9, CV_16UC1), "mono16", 100.3));  // again
    return path;
  }();
  return file;
}

DatasetOptions Topic(const std::string& topic, Sensor sensor = Sensor::kMono) {
  DatasetOptions options = With(sensor);
  options.topic = topic;
  return options;
}

TEST(BagDataset, ColourWithStampsOfTheHeadersAndTheCameraInfo) {
  const auto dataset = OpenDataset(Bag(), Topic("/colour/image_raw"));
  ASSERT_EQ(dataset->Size(), 4u);
  EXPECT_NEAR(dataset->Stamp(3), 100.3, 1e-6);
  EXPECT_TRUE(dataset->Rig().calibrated);
  EXPECT_DOUBLE_EQ(dataset->Rig().camera.fx, 60);
  EXPECT_NEAR(dataset->Rig().rate_hz, 10, 1e-3);
  const ReadResult read = dataset->Read(1);
  ASSERT_TRUE(read.frame.has_value()) << read.error;
  EXPECT_EQ(read.frame->image.type(), CV_8UC1);
  EXPECT_NEAR(read.frame->image.at<unsigned char>(10, 10), 0.114 * 200, 1);
}

TEST(BagDataset, SixteenBitIsScaledAndRepeatedStampsAreSkipped) {
  const auto dataset = OpenDataset(Bag(), Topic("/grey/image"));
  ASSERT_EQ(dataset->Size(), 4u);
  EXPECT_FALSE(dataset->Rig().calibrated);
  EXPECT_THAT(dataset->Warnings().front(), HasSubstr("repeat a time stamp"));
  const ReadResult read = dataset->Read(2);
  ASSERT_TRUE(read.frame.has_value()) << read.error;
  EXPECT_EQ(cv::norm(read.frame->image, Picture(64, 48, 2), cv::NORM_INF), 0);
}

TEST(BagDataset, DepthInItsUnitAndImagesWithoutComeAlone) {
  DatasetOptions options = Topic("/colour/image_raw", Sensor::kRgbd);
  options.depth_topic = "/depth/image";
  options.depth_units_per_m = 1000;
  const auto dataset = OpenDataset(Bag(), options);
  ASSERT_EQ(dataset->Size(), 4u);
  EXPECT_THAT(dataset->Warnings().front(), HasSubstr("1 of 4 images of /colour/image_raw have no depth"));
  ASSERT_TRUE(dataset->Read(2).frame.has_value());
  EXPECT_TRUE(dataset->Read(2).frame->depth_m.empty());
  const ReadResult read = dataset->Read(3);
  ASSERT_TRUE(read.frame.has_value()) << read.error;
  EXPECT_EQ(read.frame->index, 3);
  EXPECT_FLOAT_EQ(read.frame->depth_m.at<float>(5, 5), 1.5F);
}

TEST(BagDataset, TopicsThatAreMissingAreListed) {
  EXPECT_THAT(OpenError(Bag(), With(Sensor::kMono)), HasSubstr("/colour/image_raw /depth/image /grey/image"));
  EXPECT_THAT(OpenError(Bag(), Topic("/left")), HasSubstr("has no images of '/left'"));
  EXPECT_THAT(OpenError(Bag(), Topic("/grey/image", Sensor::kStereo)), HasSubstr("right_topic"));
}

TEST(BagDataset, DamagedFilesAreRefused) {
  const fs::path file = FreshFolder() / "cut.bag";
  fs::copy_file(Bag(), file);
  testing::Truncate(file, 0.5);
  EXPECT_THAT(OpenError(file, Topic("/grey/image")),
              AllOf(HasSubstr("cut.bag: the record at byte "), HasSubstr("beyond the file's end")));
  testing::WriteText(file, "no bag at all");
  EXPECT_THAT(OpenError(file, Topic("/grey/image")), HasSubstr("can't be read as a ROS bag"));
}

TEST(BagDataset, ImagesOfADamagedChunkAreSkippedAndCounted) {
  const fs::path file = FreshFolder() / "damaged.bag";
  {
    rosbag::Bag bag(file.string(), rosbag::bagmode::Write);
    bag.setCompression(rosbag::compression::LZ4);
    bag.setChunkThreshold(1000);  // [bytes], so that each image has a chunk
    for (int i = 0; i < 4; ++i)
      bag.write("/image", ros::Time(200 + i), Message(Picture(64, 48, i), "mono8", 100 + i));
  }
  std::ifstream in(file, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  std::size_t chunk = 0;
  for (int i = 0; i < 2; ++i) chunk = bytes.find("compression=lz4", chunk + 1);
  ASSERT_NE(chunk, std::string::npos);
  for (std::size_t i = 60; i < 160; ++i) bytes[chunk + i] = '\xff';
  testing::WriteText(file, bytes);

  const auto dataset = OpenDataset(file, Topic("/image"));
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
  const ReadResult read = OpenDataset(Bag(), options)->Read(1);
  ASSERT_TRUE(read.frame.has_value()) << read.error;
  EXPECT_EQ(cv::countNonZero(read.frame->mask != mask), 0);
}

#endif

}  // namespace
}  // namespace tutti
