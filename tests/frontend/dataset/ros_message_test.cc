#include "frontend/dataset/ros_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/bag_writer.h"
#include "tests/support/error_of.h"

namespace tutti {
namespace {
using ::testing::HasSubstr;
using testing::ImageMessage, testing::Picture;

const char* const kImage = "sensor_msgs/Image";

MessageImage Raw(const cv::Mat& image, const std::string& encoding, Pixels pixels = Pixels::kGrey) {
  return DecodeImageMessage(ImageMessage(image, encoding, 1), kImage, Serialization::kRos1, pixels);
}

TEST(DecodeImageMessage, ColoursInTheirOrder) {
  const cv::Mat red(4, 6, CV_8UC3, cv::Scalar(200, 0, 0));  // the first channel
  EXPECT_NEAR(Raw(red, "rgb8").image.at<unsigned char>(1, 1), 0.299 * 200, 1);
  EXPECT_NEAR(Raw(red, "bgr8").image.at<unsigned char>(1, 1), 0.114 * 200, 1);
  EXPECT_EQ(Raw(red, "rgb8", Pixels::kStored).image.type(), CV_8UC3);
}

TEST(DecodeImageMessage, ColoursHaveBlueFirst) {
  const auto colour = [](const cv::Mat& image, const std::string& encoding) {
    const cv::Mat read = Raw(image, encoding, Pixels::kColour).image;
    return read.type() == CV_8UC3 ? read.at<cv::Vec3b>(2, 2) : cv::Vec3b(1, 2, 3);
  };
  const cv::Mat first(4, 6, CV_8UC3, cv::Scalar(200, 0, 0)), four(4, 6, CV_8UC4, cv::Scalar(200, 0, 0, 255));
  const cv::Vec3b blue(200, 0, 0), red(0, 0, 200);
  EXPECT_EQ(colour(first, "bgr8"), blue);
  EXPECT_EQ(colour(first, "rgb8"), red);
  EXPECT_EQ(colour(four, "bgra8"), blue);
  EXPECT_EQ(colour(four, "rgba8"), red);
  EXPECT_EQ(colour(cv::Mat(4, 6, CV_8UC1, cv::Scalar(90)), "mono8"), cv::Vec3b(90, 90, 90));
}

TEST(DecodeImageMessage, VideoOfWebcams) {
  cv::Mat uyvy(4, 6, CV_8UC2, cv::Scalar(128, 0));  // no colour; brightness is the second byte
  for (int x = 0; x < uyvy.cols; ++x) uyvy.at<cv::Vec2b>(1, x)[1] = static_cast<unsigned char>(20 * x);
  cv::Mat yuyv(uyvy.size(), CV_8UC2);
  cv::mixChannels({uyvy}, {yuyv}, {0, 1, 1, 0});
  for (const auto& [encoding, image] : {std::pair("uyvy", uyvy), std::pair("yuv422", uyvy),
                                        std::pair("yuyv", yuyv), std::pair("yuv422_yuy2", yuyv)}) {
    EXPECT_EQ(Raw(image, encoding).image.at<unsigned char>(1, 4), 80) << encoding;
    EXPECT_EQ(Raw(image, encoding, Pixels::kColour).image.type(), CV_8UC3) << encoding;
  }
  EXPECT_THAT(Raw(cv::Mat(4, 5, CV_8UC2, cv::Scalar(0, 0)), "uyvy").error, HasSubstr("has an odd width"));
}

TEST(DecodeImageMessage, BayerIsNamedByItsFirstRow) {
  cv::Mat pattern(8, 8, CV_8UC1, cv::Scalar(0));
  for (int y = 0; y < 8; y += 2) {
    for (int x = 0; x < 8; x += 2) pattern.at<unsigned char>(y, x) = 200;  // red alone
  }
  EXPECT_NEAR(Raw(pattern, "bayer_rggb8").image.at<unsigned char>(4, 4), 0.299 * 200, 2);
  EXPECT_NEAR(Raw(pattern, "bayer_bggr8").image.at<unsigned char>(4, 4), 0.114 * 200, 2);
  const cv::Vec3b red = Raw(pattern, "bayer_rggb8", Pixels::kColour).image.at<cv::Vec3b>(4, 4);
  EXPECT_EQ(red, cv::Vec3b(0, 0, 200));
  pattern.convertTo(pattern, CV_16U, 16);
  EXPECT_NEAR(Raw(pattern, "bayer_rggb16").image.at<std::uint16_t>(4, 4), 0.299 * 3200, 32);
}

TEST(DecodeImageMessage, DepthAsStored) {
  const MessageImage metres = Raw(cv::Mat(3, 3, CV_32FC1, cv::Scalar(2.5)), "32FC1", Pixels::kStored);
  EXPECT_TRUE(metres.metres);
  EXPECT_EQ(metres.image.at<float>(2, 2), 2.5F);
  const MessageImage units = Raw(cv::Mat(3, 3, CV_16UC1, cv::Scalar(2500)), "16UC1", Pixels::kStored);
  EXPECT_FALSE(units.metres);
  EXPECT_EQ(units.image.at<std::uint16_t>(2, 2), 2500);
}

TEST(DecodeImageMessage, CompressedOnes) {
  std::vector<unsigned char> png;
  cv::imencode(".png", Picture(16, 12, 5), png);
  const std::string type = "sensor_msgs/CompressedImage";
  const MessageImage read = DecodeImageMessage(testing::CompressedMessage(png, "png", 1), type,
                                               Serialization::kRos1, Pixels::kGrey);
  EXPECT_EQ(cv::norm(read.image, Picture(16, 12, 5), cv::NORM_INF), 0) << read.error;
  const MessageImage colour = DecodeImageMessage(testing::CompressedMessage(png, "png", 1), type,
                                                 Serialization::kRos1, Pixels::kColour);
  EXPECT_EQ(colour.image.type(), CV_8UC3) << colour.error;
  png.resize(png.size() / 2);
  EXPECT_THAT(
      DecodeImageMessage(testing::CompressedMessage(png, "png", 1), type, Serialization::kRos1, Pixels::kGrey)
          .error,
      HasSubstr("a compressed image ('png') is truncated"));
}

TEST(DecodeImageMessage, CompressedDepth) {
  const cv::Mat stored(4, 5, CV_16UC1, cv::Scalar(1500));
  std::vector<unsigned char> png;
  cv::imencode(".png", stored, png);
  const auto read = [&](const std::string& format, float a, float b) {
    std::vector<unsigned char> bytes(12);
    std::memcpy(bytes.data() + 4, &a, sizeof a);
    std::memcpy(bytes.data() + 8, &b, sizeof b);
    bytes.insert(bytes.end(), png.begin(), png.end());
    return DecodeImageMessage(testing::CompressedMessage(bytes, format, 1), "sensor_msgs/CompressedImage",
                              Serialization::kRos1, Pixels::kStored);
  };
  const MessageImage units = read("16UC1; compressedDepth png", 0, 0);
  EXPECT_EQ(units.error, "");
  EXPECT_FALSE(units.metres);
  EXPECT_EQ(cv::norm(units.image, stored, cv::NORM_INF), 0);
  const MessageImage metres = read("32FC1; compressedDepth", 2800, 100);
  EXPECT_TRUE(metres.metres);
  EXPECT_FLOAT_EQ(metres.image.at<float>(3, 4), 2);  // 2800 / (1500 - 100)
  EXPECT_THAT(read("16UC1; compressedDepth rvl", 0, 0).error, HasSubstr("can't be read; record it as png"));
}

TEST(DecodeImageMessage, SaysWhatIsWrong) {
  const cv::Mat image = Picture(8, 6, 1);
  EXPECT_THAT(Raw(image, "nv21").error, HasSubstr("encoding 'nv21'"));
  EXPECT_THAT(Raw(image, "rgb8").error, HasSubstr("8 x 6 pixels"));
  const std::string message = ImageMessage(image, "mono8", 1);
  for (std::size_t size = 0; size < message.size(); ++size)
    EXPECT_NE(DecodeImageMessage(message.substr(0, size), kImage, Serialization::kRos1, Pixels::kGrey).error,
              "")
        << size;
  for (std::size_t i = 0; i + 4 <= 50; ++i) {  // any length may be a lie
    std::string changed = message;
    changed.replace(i, 4, "\xff\xff\xff\x7f");
    const MessageImage read = DecodeImageMessage(changed, kImage, Serialization::kRos1, Pixels::kGrey);
    EXPECT_EQ(read.image.empty(), !read.error.empty());
  }
}

TEST(DecodeCameraInfo, GivesPinholeAndLens) {
  const std::array<double, 9> K = {20, 0, 8, 0, 21, 6, 0, 0, 1};
  const auto camera = [&](const std::string& model, const std::vector<double>& lens) {
    return DecodeCameraInfo(testing::CameraInfoMessage({16, 12}, K, model, lens), Serialization::kRos1,
                            "x.bag")
        .Raw("x.bag");
  };
  const PinholeCamera plain = camera("plumb_bob", {0, 0, 0, 0, 0});
  EXPECT_EQ(plain.distortion, Distortion::kNone);
  EXPECT_EQ(plain.width, 16);
  EXPECT_EQ(plain.fy, 21);
  EXPECT_EQ(plain.cx, 8);
  const PinholeCamera lens = camera("plumb_bob", {0.1, 0.2, 0.3, 0.4, 0.5});
  EXPECT_EQ(lens.distortion, Distortion::kRadTan);
  EXPECT_EQ(lens.coefficients[4], 0.5);
  EXPECT_EQ(camera("equidistant", {0.1, 0, 0, 0}).distortion, Distortion::kEquidistant);
  EXPECT_EQ(camera("equidistant", {0, 0, 0, 0}).distortion, Distortion::kEquidistant) << "no pinhole";
  EXPECT_EQ(camera("rational_polynomial", {0.1, 0, 0, 0, 0, 0, 0, 0}).coefficients[0], 0.1);
  EXPECT_THAT(testing::ErrorOf([&] {
                camera("rational_polynomial", {0.1, 0, 0, 0, 0, 0.2, 0, 0});
              }),
              HasSubstr("number 6 is not 0"));
  EXPECT_THAT(testing::ErrorOf([&] { camera("odd", {0.1}); }), HasSubstr("the lens model 'odd'"));
  EXPECT_FALSE(DecodeCameraInfo(testing::CameraInfoMessage({16, 12}, {}, "plumb_bob", {}),
                                Serialization::kRos1, "x.bag")
                   .IsCalibrated());
  EXPECT_THAT(testing::ErrorOf([&] { DecodeCameraInfo("short", Serialization::kRos1, "x.bag"); }),
              HasSubstr("x.bag"));
}

// By hand, beside bags_of_ros2_test.cc: where each value must lie.
TEST(DecodeImageMessage, OfRos2IsAligned) {
  const auto message = [](const std::string& frame) {
    std::string bytes("\x00\x01\x00\x00", 4);
    const auto put = [&](std::uint32_t value) {
      while (bytes.size() % 4 != 0) bytes += 'x';  // what is between is not looked at
      bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
    };
    const auto put_text = [&](const std::string& text) {
      put(static_cast<std::uint32_t>(text.size() + 1));
      bytes += text + '\0';
    };
    put(100);
    put(500);
    put_text(frame);
    put(2);  // rows
    put(3);  // columns
    put_text("mono8");
    bytes += '\0';  // little-endian
    put(3);
    put(6);
    return bytes + "abcdef";
  };
  for (const char* frame : {"", "a", "ab", "abc", "abcd", "abcde"}) {
    const MessageImage read = DecodeImageMessage(message(frame), kImage, Serialization::kCdr, Pixels::kGrey);
    ASSERT_EQ(read.error, "") << frame;
    EXPECT_EQ(read.image.size(), cv::Size(3, 2));
    EXPECT_EQ(read.image.at<unsigned char>(1, 2), 'f');
  }
  const std::string whole = message("ab");
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_NE(DecodeImageMessage(whole.substr(0, size), kImage, Serialization::kCdr, Pixels::kGrey).error, "")
        << size;
  const auto error = [&](const std::string& kind) {
    return DecodeImageMessage(kind + whole.substr(4), kImage, Serialization::kCdr, Pixels::kGrey).error;
  };
  EXPECT_THAT(error(std::string("\x00\x00\x00\x00", 4)), HasSubstr("is not serialized as little-endian CDR"));
  EXPECT_THAT(error("\x28\xb5\x2f\xfd"), HasSubstr("not serialized"));
}

TEST(NameOfType, IsThatOfRos1) {
  EXPECT_EQ(NameOfType("sensor_msgs/msg/Image"), "sensor_msgs/Image");
  EXPECT_EQ(NameOfType("sensor_msgs/Image"), "sensor_msgs/Image");
  EXPECT_EQ(NameOfType(""), "");
}

}  // namespace
}  // namespace tutti
