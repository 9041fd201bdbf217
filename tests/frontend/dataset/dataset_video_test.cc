// Videos: the times of their frames, their orientation, the shape of their pixels, pipes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <opencv2/videoio.hpp>
#include <optional>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/matroska_writer.h"
#include "tests/support/pipe_sender.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf, ::testing::HasSubstr;
using testing::FrameOf, testing::FreshFolder, testing::MatroskaWriter, testing::OpenError, testing::With;

// Each frame is brighter than the one before.
cv::Mat Shade(int i) { return cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(20 * i + 20)); }
int NumberOf(const cv::Mat& image) { return static_cast<int>(std::lround((cv::mean(image)[0] - 20) / 20)); }

MatroskaWriter WithTimes(const std::vector<int>& milliseconds, cv::Size shown = {}) {
  MatroskaWriter writer({64, 48}, shown);
  for (std::size_t i = 0; i < milliseconds.size(); ++i)
    writer.Add(Shade(static_cast<int>(i)), milliseconds[i]);
  return writer;
}

fs::path Video(const std::vector<int>& milliseconds, cv::Size shown = {}) {
  const fs::path file = FreshFolder() / "video.mkv";
  WithTimes(milliseconds, shown).Write(file);
  return file;
}

// Each frame with its stamp, as it comes.
void ExpectFrames(const Dataset& dataset, const std::vector<double>& stamps_s) {
  for (std::size_t i = 0; i < stamps_s.size(); ++i) {
    ASSERT_TRUE(dataset.WaitFor(i, [] { return false; })) << i;
    const ReadResult read = dataset.Read(i);
    ASSERT_TRUE(read.frame) << read.error;
    EXPECT_EQ(NumberOf(read.frame->image), static_cast<int>(i));
    EXPECT_NEAR(read.frame->stamp_s, stamps_s[i], 1e-9);
    EXPECT_NEAR(dataset.Stamp(i), stamps_s[i], 1e-9);
  }
  EXPECT_FALSE(dataset.WaitFor(stamps_s.size(), [] { return false; }));
}

// The rotation flag of phones: the display matrix of the track (ISO/IEC 14496-12, 8.3.2).
bool WriteTurned(const fs::path& file, int degrees, cv::Size size) {
  cv::VideoWriter writer;
  if (!writer.open(file.string(), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('m', 'p', '4', 'v'), 10, size))
    return false;
  for (int i = 0; i < 3; ++i) {
    cv::Mat image(size, CV_8UC3, cv::Scalar::all(30));
    image(cv::Rect(0, 0, size.width / 2, size.height / 2)).setTo(cv::Scalar::all(220));
    writer.write(image);
  }
  writer.release();
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  const std::size_t matrix = bytes.find("tkhd") + 4 + 40;  // of version 0
  const std::string one("\0\1\0\0", 4), minus("\xff\xff\0\0", 4), zero(4, '\0');
  const std::string a = degrees == 180 ? minus : zero, b = degrees == 90    ? one
                                                           : degrees == 270 ? minus
                                                                            : zero;
  const std::string c = degrees == 90 ? minus : degrees == 270 ? one : zero;
  bytes.replace(matrix, 20, a + b + zero + c + a);
  std::ofstream(file, std::ios::binary) << bytes;
  return true;
}

TEST(Video, FramesHaveTheTimesOfItsContainerAlsoAsACamera) {
  const std::vector<double> stamps = {0, 0.033, 0.3, 0.333, 1.9, 2.5, 2.51};
  const fs::path file = Video({0, 33, 300, 333, 1900, 2500, 2510});
  const auto dataset = OpenDataset(file, With(Sensor::kMono, true));
  ASSERT_EQ(dataset->Size(), stamps.size());
  EXPECT_EQ(NumberOf(dataset->Read(6).frame->image), 6);  // what lies between is decoded, and not lost
  ExpectFrames(*dataset, stamps);
  ExpectFrames(*OpenDataset("camera:" + file.string(), With(Sensor::kMono, true)), stamps);
  DatasetOptions of_rate = With(Sensor::kMono, true);
  of_rate.rate_hz = 4;
  EXPECT_DOUBLE_EQ(OpenDataset(file, of_rate)->Stamp(6), 1.5);
}

TEST(Video, TimesCountFromItsFirstFrameAndAPartOfItKeepsThem) {
  DatasetOptions part = With(Sensor::kMono, true);
  part.start = 2;
  part.stride = 2;
  const auto dataset = OpenDataset(Video({5000, 5100, 5500, 5600, 6000}), part);
  ASSERT_EQ(dataset->Size(), 2u);
  EXPECT_NEAR(dataset->Stamp(1), 1.0, 1e-9);
  EXPECT_EQ(NumberOf(dataset->Read(0).frame->image), 2);
  EXPECT_EQ(NumberOf(dataset->Read(1).frame->image), 4);
}

TEST(Video, FramesThatRepeatATimeAreSkippedAndCounted) {
  const auto dataset = OpenDataset(Video({0, 100, 100, 200}), With(Sensor::kMono, true));
  ASSERT_EQ(dataset->Size(), 3u);
  EXPECT_THAT(dataset->Warnings().front(), HasSubstr("1 of 4 frames repeat a time stamp"));
  EXPECT_EQ(dataset->SkippedShare(), 0.25);
  EXPECT_EQ(NumberOf(dataset->Read(2).frame->image), 3);
}

TEST(Video, TimesThatJumpBackAreRefusedWithThePlace) {
  const fs::path file = Video({0, 1000, 2000, 100, 1100});
  for (const std::string& name : {file.string(), "camera:" + file.string()}) {
    EXPECT_THAT(OpenError(name, With(Sensor::kMono, true)),
                AllOf(HasSubstr("jump back at image 3"), HasSubstr("from 2.000000 s to 0.100000 s")));
  }
}

TEST(Video, DamagedFramesAreToldAndTheRestKeepTheirTimes) {
  const fs::path file = Video({0, 100, 300, 400});
  std::ifstream in(file, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(in), {}};
  std::size_t jpeg = 0;
  for (int i = 0; i < 2; ++i) jpeg = bytes.find("\xff\xd8\xff", jpeg + 1);
  bytes.replace(jpeg, 200, 200, '\0');
  std::ofstream(file, std::ios::binary) << bytes;
  const auto dataset = OpenDataset(file, With(Sensor::kMono, true));
  ASSERT_EQ(dataset->Size(), 4u);
  EXPECT_THAT(dataset->Read(1).error, HasSubstr("frame 1 can't be decoded"));
  const InputFrame read = FrameOf(*dataset, 2);
  EXPECT_EQ(NumberOf(read.image), 2);
  EXPECT_NEAR(read.stamp_s, 0.3, 1e-9);
  EXPECT_EQ(dataset->Read(1).error.empty(), false);
}

// What encoders with frames that refer to later ones do: the decoder holds the last ones back.
TEST(Video, TheLastFramesOfH264HaveTheirTimesToo) {
  if (std::system("ffmpeg -version > /dev/null 2>&1") != 0) GTEST_SKIP() << "ffmpeg is not installed";
  const fs::path folder = FreshFolder();
  for (const char* name : {"a.mp4", "a.mkv", "a.ts"}) {
    const std::string file = (folder / name).string();
    // 30 frames at 10/s, of which a half is left out without a rhythm.
    const std::string command =
        "ffmpeg -v error -y -f lavfi -i testsrc=size=64x48:rate=10:duration=3 -vf "
        "\"select='not(mod(n,7))+gt(mod(n*n,11),4)'\" -vsync passthrough -c:v libx264 -bf 3 " +
        file;
    if (std::system(command.c_str()) != 0) GTEST_SKIP() << "this ffmpeg has no libx264";
    std::vector<double> stamps;
    for (int n = 0; n < 30; ++n) {
      if (n % 7 == 0 || n * n % 11 > 4) stamps.push_back(0.1 * n);
    }
    const auto dataset = OpenDataset(file, With(Sensor::kMono, true));
    ASSERT_EQ(dataset->Size(), stamps.size()) << name;
    for (std::size_t i = 0; i < stamps.size(); ++i) EXPECT_NEAR(dataset->Stamp(i), stamps[i], 1e-3) << name;
    EXPECT_TRUE(dataset->Read(stamps.size() - 1).frame);
  }
}

TEST(Video, ThatItsFlagTurnsTurnsTheSensorsCameraToo) {
  const fs::path file = FreshFolder() / "phone.mp4";
  PinholeCamera camera = testing::SmallCamera();
  camera.cx = 40;
  camera.cy = 20;
  DatasetOptions options = With(Sensor::kMono);
  options.camera = camera;
  for (const int degrees : {90, 180, 270}) {
    if (!WriteTurned(file, degrees, {64, 48})) GTEST_SKIP() << "this OpenCV can't write a video";
    for (const std::string& name : {file.string(), "camera:" + file.string()}) {
      const auto dataset = OpenDataset(name, options);
      const PinholeCamera& turned = dataset->Rig().camera;
      EXPECT_EQ(turned.width, degrees == 180 ? 64 : 48);
      EXPECT_EQ(turned.cx, degrees == 90 ? 47 - 20 : degrees == 180 ? 63 - 40 : 20);
      EXPECT_EQ(turned.cy, degrees == 90 ? 40 : degrees == 180 ? 47 - 20 : 63 - 40);
      EXPECT_THAT(dataset->Warnings().front(),
                  AllOf(HasSubstr("rotation flag says " + std::to_string(degrees)),
                        HasSubstr("sensor's own orientation (64x48)")));
      const cv::Mat image = dataset->Read(0).frame->image;  // the bright corner was top left
      EXPECT_GT(
          image.at<unsigned char>(degrees == 90 ? 5 : image.rows - 5, degrees == 270 ? 5 : image.cols - 5),
          150);
    }
  }
  // One of the images as they are shown is left as it is, also where its size is not known.
  WriteTurned(file, 90, {64, 48});
  for (const int width : {48, 0}) {
    options.camera = camera;
    options.camera->width = width;
    options.camera->height = width > 0 ? 64 : 0;
    options.camera->cx = 23;
    options.camera->cy = 33;
    EXPECT_EQ(OpenDataset(file, options)->Rig().camera.cx, 23);
  }
  DatasetOptions of_view = With(Sensor::kMono);
  of_view.fov_deg = 90;  // of the sensor, which is 64 pixels wide
  EXPECT_NEAR(OpenDataset(file, of_view)->Rig().camera.fx, 32, 1e-9);
  options.readout_s = 0.01;
  EXPECT_THAT(OpenError(file, options), HasSubstr("rolling shutter"));
}

TEST(Video, PixelsThatAreNotSquareMakeOtherFocalLengths) {
  const fs::path file = Video({0, 100}, {96, 48});  // half as wide again
  DatasetOptions options = With(Sensor::kMono);
  options.fov_deg = 90;
  const auto seen = OpenDataset(file, options);
  EXPECT_THAT(seen->Warnings().front(), HasSubstr("its pixels are 1.5"));
  EXPECT_NEAR(seen->Rig().camera.fx, 32, 1e-9);
  EXPECT_NEAR(seen->Rig().camera.fy, 48, 1e-9);
  options.camera = testing::SmallCamera();  // of square pixels
  options.camera->width = 96;
  options.camera->cx = 47.5;
  const PinholeCamera narrowed = OpenDataset(file, options)->Rig().camera;
  EXPECT_EQ(narrowed.width, 64);
  EXPECT_NEAR(narrowed.fx, 40, 1e-9);
  EXPECT_NEAR(narrowed.fy, 60, 1e-9);
  EXPECT_NEAR(narrowed.cx, 31.5, 1e-9);
}

TEST(Video, MayComeThroughAPipe) {
  const fs::path pipe = FreshFolder() / "pipe";
  std::optional<testing::PipeSender> sender(std::in_place, pipe, WithTimes({0, 33, 300, 333, 1900}).Bytes());
  EXPECT_TRUE(IsPipe(pipe));
  EXPECT_TRUE(IsCamera(pipe));
  EXPECT_FALSE(IsCameraDevice(pipe));
  const auto dataset = OpenDataset(pipe, With(Sensor::kMono, true));
  EXPECT_EQ(dataset->FrameSupply(), Supply::kOnce);
  ExpectFrames(*dataset, {0, 0.033, 0.3, 0.333, 1.9});
  sender.emplace(pipe, "no video");
  EXPECT_THAT(OpenError(pipe, With(Sensor::kMono, true)), HasSubstr("can't be read as a video"));
}

}  // namespace
}  // namespace tutti
