#include "frontend/dataset/camera_input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/error_of.h"
#include "tests/support/matroska_writer.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {
using testing::ErrorOf, testing::FreshFolder, testing::WriteImage;
using ::testing::HasSubstr;

// A device whose queue holds images that were taken at these times.
class QueueOfImages {
 public:
  explicit QueueOfImages(std::deque<double> times) : times_(std::move(times)) {}
  bool Grab() {
    if (times_.empty()) return false;
    taken_at_ = times_.front();
    times_.pop_front();
    return true;
  }
  double TakenAt() const { return taken_at_; }

 private:
  std::deque<double> times_;
  double taken_at_ = 0;
};

constexpr double kPeriod = 0.1;

GrabbedPair Grab(QueueOfImages& first, QueueOfImages& second) {
  int calls = 0;
  return GrabTogether(first, second, kPeriod, [&] { return static_cast<double>(++calls); });
}

TEST(GrabTogether, ImagesOfTheSameTimeAreAPair) {
  QueueOfImages first({5.0, 5.1}), second({5.01, 5.11});
  const GrabbedPair got = Grab(first, second);
  EXPECT_TRUE(got.first && got.second);
  EXPECT_EQ(first.TakenAt(), 5.0);
  EXPECT_EQ(second.TakenAt(), 5.01);
  EXPECT_EQ(got.first_s, 1);
}

TEST(GrabTogether, TheOneThatFellBehindCatchesUp) {
  QueueOfImages first({5.0, 5.1, 5.2, 5.3, 5.4}), second({5.32, 5.42});
  const GrabbedPair late_first = Grab(first, second);
  EXPECT_EQ(first.TakenAt(), 5.3);
  EXPECT_EQ(second.TakenAt(), 5.32);
  EXPECT_EQ(late_first.first_s, 4);  // the stamp is that of the image that is used
  QueueOfImages ahead({7.0}), behind({6.7, 6.8, 6.9, 7.0});
  EXPECT_TRUE(Grab(ahead, behind).second);
  EXPECT_EQ(behind.TakenAt(), 7.0);
}

TEST(GrabTogether, SlowerImagesThanWereAskedForDoNotChaseEachOther) {
  QueueOfImages first({5.0, 5.4, 5.8}), second({5.2, 5.6, 6.0});
  EXPECT_TRUE(Grab(first, second).first);
  EXPECT_EQ(first.TakenAt(), 5.4);
  EXPECT_EQ(second.TakenAt(), 5.2);
}

TEST(GrabTogether, WithoutTimesTheImagesArePairedAsTheyCome) {
  QueueOfImages first({0, 0}), second({0, 0});
  EXPECT_TRUE(Grab(first, second).second);
  QueueOfImages times({5, 6}), none({0, 0});
  EXPECT_TRUE(Grab(times, none).second);
  EXPECT_EQ(times.TakenAt(), 5);
}

TEST(GrabTogether, SaysWhichCameraEnded) {
  QueueOfImages first({5.0}), ended({});
  EXPECT_TRUE(Grab(first, ended).first);
  QueueOfImages again({5.0}), gone({});
  EXPECT_FALSE(Grab(again, gone).second);
  QueueOfImages only({5.0}), empty({});
  EXPECT_FALSE(Grab(empty, only).first);
  EXPECT_EQ(only.TakenAt(), 0) << "an image is not taken for a frame that never comes";
}

TEST(CameraInput, DepthMayComeFromAFolderOfImages) {
  const std::filesystem::path folder = FreshFolder() / "depth";
  for (int i = 0; i < 3; ++i)
    WriteImage(folder / (std::to_string(9 + i) + ".png"), cv::Mat(48, 64, CV_16UC1, cv::Scalar(60000 + i)));
  testing::Truncate(folder / "10.png", 0.5);
  CameraInput input("camera:x,y", folder.string(), CameraContent::kDepth, {});
  EXPECT_EQ(input.TakenAt(), 0);
  cv::Mat image;
  ASSERT_TRUE(input.Grab());
  EXPECT_EQ(input.Retrieve(image), "");
  EXPECT_EQ(image.at<std::uint16_t>(3, 5), 60000);  // 9.png before 10.png
  ASSERT_TRUE(input.Grab());
  EXPECT_THAT(input.Retrieve(image), HasSubstr("10.png"));
  EXPECT_TRUE(image.empty());
  ASSERT_TRUE(input.Grab());
  EXPECT_EQ(input.Retrieve(image), "");
  EXPECT_FALSE(input.Grab());
}

TEST(CameraInput, DepthMayComeFromA16BitVideo) {
  const std::filesystem::path file = FreshFolder() / "depth.mkv";
  testing::MatroskaWriter writer({64, 48}, {}, true);
  writer.Add(cv::Mat(48, 64, CV_16UC1, cv::Scalar(60001)), 0);
  writer.Write(file);
  CameraInput input("camera:x,y", file, CameraContent::kDepth, {});
  cv::Mat image;
  ASSERT_TRUE(input.Grab());
  EXPECT_EQ(input.Retrieve(image), "");
  EXPECT_EQ(image.at<std::uint16_t>(3, 5), 60001);
}

TEST(CameraInput, ThatCantBeOpenedIsNamed) {
  const std::filesystem::path folder = FreshFolder();
  const auto error = [](const std::string& source, CameraContent content) {
    return ErrorOf([&] { CameraInput("camera:a,b", source, content, {}); });
  };
  EXPECT_THAT(error("998", CameraContent::kGrey),
              HasSubstr("camera:a,b: there is no such camera (/dev/video998)"));
  EXPECT_THAT(error("998", CameraContent::kDepth), HasSubstr("Y16"));
  EXPECT_THAT(error(folder, CameraContent::kDepth), HasSubstr("holds no depth images"));
  EXPECT_THAT(error(folder, CameraContent::kGrey), HasSubstr("can't be opened as a video"));
  EXPECT_THAT(error(folder / "none.mkv", CameraContent::kDepth), HasSubstr("can't be opened as a video"));
}

}  // namespace
}  // namespace tutti
