// Sources that grow: a folder that is being written to, a camera (a video file in its stead).
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::FrameOf, testing::FreshFolder, testing::OpenError, testing::Picture, testing::With,
    testing::WriteImage;
using ::testing::HasSubstr;

bool Never() { return false; }

DatasetOptions Follow(double seconds) {
  DatasetOptions options = With(Sensor::kMono, true);
  options.follow_s = seconds;
  return options;
}

TEST(FollowedFolder, WaitsForImagesThatAreStillToCome) {
  const fs::path folder = FreshFolder() / "images";
  WriteImage(folder / "0.png", Picture(64, 48, 0));
  const auto dataset = OpenDataset(folder, Follow(60));
  EXPECT_EQ(dataset->FrameSupply(), Supply::kGrowing);
  EXPECT_EQ(dataset->Size(), 1u);
  EXPECT_TRUE(dataset->WaitFor(0, Never));
  int written = 0;
  // The writer comes to its turn whenever the reader asks whether it shall stop.
  EXPECT_TRUE(dataset->WaitFor(1, [&] {
    if (written++ == 1) WriteImage(folder / "1.png", Picture(64, 48, 1));
    return false;
  }));
  EXPECT_EQ(dataset->Size(), 2u);
  const ReadResult read = dataset->Read(1);
  ASSERT_TRUE(read.frame.has_value()) << read.error;
  EXPECT_EQ(read.frame->index, 1);
  EXPECT_EQ(cv::norm(read.frame->image, Picture(64, 48, 1), cv::NORM_L1), 0);
  EXPECT_TRUE(dataset->Read(0).frame.has_value());  // what is there can be read again
}

TEST(FollowedFolder, AHalfWrittenImageIsWaitedFor) {
  const fs::path folder = FreshFolder() / "images", part = folder / "1.png";
  WriteImage(folder / "0.png", Picture(64, 48, 0));
  const auto dataset = OpenDataset(folder, Follow(60));
  WriteImage(part, Picture(64, 48, 1));
  testing::Truncate(part, 0.5);
  int asked = 0;
  EXPECT_TRUE(dataset->WaitFor(1, [&] {
    if (asked++ == 1) WriteImage(part, Picture(64, 48, 1));
    return false;
  }));
  EXPECT_GE(asked, 2);
  EXPECT_TRUE(dataset->Read(1).frame.has_value());
}

TEST(FollowedFolder, DepthThatIsListedLaterIsWaitedForUnlessANewerFrameHasIt) {
  const fs::path folder = FreshFolder();
  for (int i = 0; i < 3; ++i) WriteImage(folder / (std::to_string(i) + ".png"), Picture(64, 48, i));
  WriteImage(folder / "depth.png", cv::Mat(48, 64, CV_16UC1, cv::Scalar(5000)));
  testing::WriteText(folder / "rgb.txt", "0.0 0.png\n1.0 1.png\n");
  testing::WriteText(folder / "depth.txt", "0.0 depth.png\n");
  DatasetOptions options = Follow(60);
  options.sensor = Sensor::kRgbd;
  const auto dataset = OpenDataset(folder, options);
  EXPECT_TRUE(dataset->Warnings().empty());
  int asked = 0;
  EXPECT_TRUE(dataset->WaitFor(1, [&] {
    if (asked++ == 1) testing::WriteText(folder / "depth.txt", "0.0 depth.png\n1.0 depth.png\n");
    return false;
  }));
  EXPECT_GE(asked, 2);
  EXPECT_FALSE(dataset->Read(1).frame->depth_m.empty());
  testing::WriteText(folder / "rgb.txt", "0.0 0.png\n1.0 1.png\n2.0 2.png\n3.0 2.png\n");
  testing::WriteText(folder / "depth.txt", "0.0 depth.png\n1.0 depth.png\n3.0 depth.png\n");
  asked = 0;
  EXPECT_TRUE(dataset->WaitFor(2, [&] { return ++asked > 100; }));
  EXPECT_EQ(asked, 0);
  const InputFrame alone = FrameOf(*dataset, 2);
  EXPECT_EQ(alone.index, 2);
  EXPECT_TRUE(alone.depth_m.empty());
}

TEST(FollowedFolder, EndsWithoutNewImagesAndWhenAskedTo) {
  const fs::path folder = FreshFolder() / "images";
  WriteImage(folder / "0.png", Picture(64, 48, 0));
  EXPECT_FALSE(OpenDataset(folder, Follow(0.01))->WaitFor(1, Never));
  EXPECT_FALSE(OpenDataset(folder, Follow(60))->WaitFor(1, [] { return true; }));
}

TEST(FollowedFolder, ANameThatSortsBeforeKnownOnesIsToldAtTheEnd) {
  const fs::path folder = FreshFolder() / "images";
  WriteImage(folder / "5.png", Picture(64, 48, 0));
  const auto dataset = OpenDataset(folder, Follow(0.01));
  WriteImage(folder / "4.png", Picture(64, 48, 1));
  EXPECT_TRUE(dataset->WaitFor(1, Never));
  EXPECT_THAT(dataset->Read(1).error, HasSubstr("sorts before"));
  EXPECT_FALSE(dataset->WaitFor(1, Never));
}

TEST(FollowedFolder, AnEmptyOrMissingFolderIsNamed) {
  const fs::path folder = FreshFolder();
  fs::create_directories(folder / "empty");
  EXPECT_THAT(OpenError(folder / "empty", Follow(0.01)), HasSubstr("is empty"));
  EXPECT_THAT(OpenError(folder / "nowhere", Follow(0.01)), HasSubstr("is no folder"));
}

class Camera : public ::testing::Test {
 protected:
  void SetUp() override {
    file_ = FreshFolder() / "camera.avi";
    std::vector<cv::Mat> images;
    for (int i = 0; i < 5; ++i) images.emplace_back(48, 64, CV_8UC3, cv::Scalar::all(40 * i + 20));
    if (!testing::WriteMotionJpeg(file_, images)) GTEST_SKIP() << "this OpenCV can't write a video";
  }
  fs::path file_;
};

TEST_F(Camera, FramesComeOnceAndInOrder) {
  const auto dataset = OpenDataset("camera:" + file_.string(), With(Sensor::kMono, true));
  EXPECT_EQ(dataset->FrameSupply(), Supply::kOnce);
  for (std::size_t i = 0; i < 5; ++i) {
    ASSERT_TRUE(dataset->WaitFor(i, Never));
    const InputFrame read = FrameOf(*dataset, i);
    EXPECT_EQ(read.index, static_cast<std::int64_t>(i));
    EXPECT_NEAR(read.stamp_s, static_cast<double>(i) / 25, 1e-9);
    EXPECT_NEAR(cv::mean(read.image)[0], 40.0 * static_cast<double>(i) + 20, 4);
  }
  EXPECT_FALSE(dataset->WaitFor(5, Never));
  EXPECT_THAT(dataset->Read(0).error, HasSubstr("come once"));
}

TEST_F(Camera, StopsWhenAskedTo) {
  const auto dataset = OpenDataset("camera:" + file_.string(), With(Sensor::kMono));
  EXPECT_FALSE(dataset->WaitFor(3, [] { return true; }));
  EXPECT_FALSE(dataset->Rig().calibrated);
}

TEST(CameraNames, OnlyNumbersAreDevices) {
  EXPECT_TRUE(IsCameraDevice("camera:0"));
  EXPECT_FALSE(IsCameraDevice("camera:video.avi"));
  EXPECT_TRUE(IsCamera("camera:video.avi"));
  EXPECT_FALSE(IsCamera("video.avi"));
  EXPECT_THAT(OpenError("camera:999", With(Sensor::kMono)), HasSubstr("no such camera"));
}

}  // namespace
}  // namespace tutti
