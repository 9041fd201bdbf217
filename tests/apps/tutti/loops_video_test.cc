// `tutti loops` on a video.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "tests/apps/tutti/loops_fixture.h"
#include "tests/support/matroska_writer.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;

class LoopsOfAVideo : public testing::LoopsFixture {
 protected:
  void SetUp() override {
    cv::VideoWriter writer;
    for (int i = 0; i < testing::kLoopImages; ++i) {
      cv::Mat image = testing::LoopImage(i);
      if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
      if (i == 0) writer.open(video_.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, image.size());
      if (!writer.isOpened()) GTEST_SKIP() << "this OpenCV can't write a video";
      writer.write(image);
    }
  }

  const fs::path video_ = folder_ / "walk.avi";
};

TEST_F(LoopsOfAVideo, AreThoseOfItsFrames) {
  cv::VideoCapture capture(video_.string());
  cv::Mat frame;
  fs::create_directories(folder_ / "frames");
  for (int i = 0; capture.read(frame); ++i)
    cv::imwrite((folder_ / "frames" / (std::to_string(i) + ".png")).string(), frame);
  const auto of_video = List(video_, "a"), of_frames = List(folder_ / "frames", "b");
  ASSERT_EQ(of_video.status, 0) << of_video.output;
  ASSERT_EQ(of_frames.status, 0) << of_frames.output;
  EXPECT_EQ(Listed("a"), Listed("b"));
  EXPECT_THAT(Listed("a"), HasSubstr("\n17,2,"));
  EXPECT_THAT(ReadAll(folder_ / "a" / "loops.csv"), HasSubstr("\"frame 17\",\"frame 2\""));
  const cv::Mat a = cv::imread((folder_ / "a" / "contact_sheet.png").string());
  const cv::Mat b = cv::imread((folder_ / "b" / "contact_sheet.png").string());
  ASSERT_EQ(a.size(), b.size());
  const cv::Rect pictures(0, 84 + 84, a.cols, 240);  // the first strip's, without its words
  EXPECT_EQ(cv::norm(a(pictures), b(pictures), cv::NORM_L1), 0);
}

TEST_F(LoopsOfAVideo, MayBeOfEveryThirdFrame) {
  const auto run = List(video_, "third", {"--stride", "3"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_EQ(nlohmann::json::parse(ReadAll(folder_ / "third" / "results.json"))["images"], 7);
  EXPECT_THAT(ReadAll(folder_ / "third" / "hypotheses.csv"), HasSubstr("frame 18"));
}

TEST_F(LoopsOfAVideo, AreJudgedByTheTimesOfItsContainer) {
  testing::MatroskaWriter writer(testing::LoopImage(0).size());
  std::string poses;
  for (int i = 0; i < testing::kLoopImages; ++i) {
    const int milliseconds = 1000 * i + 300 * (i % 3);
    writer.Add(testing::LoopImage(i), milliseconds);
    // Ten times as many as there are frames, and where the camera was at its time of that frame.
    for (int part = 0; part < 10; ++part)
      poses += std::to_string(1e-3 * milliseconds + 0.01 * part) + " " +
               std::to_string(10 * (i % testing::kLoopPlaces)) + " 0 0 0 0 0 1\n";
  }
  writer.Write(folder_ / "walk.mkv");
  testing::WriteAll(folder_ / "poses.txt", poses);
  const auto run = List(folder_ / "walk.mkv", "judged",
                        {"--ground-truth", (folder_ / "poses.txt").string(), "--gt-exclude-s", "5"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_EQ(Json(folder_ / "judged" / "results.json")["rows_with_loop"], 5) << run.output;
}

TEST_F(LoopsOfAVideo, OrOfAFolderAreNotLookedForUnderAMask) {
  cv::VideoCapture capture(video_.string());
  cv::Mat frame;
  ASSERT_TRUE(capture.read(frame));
  cv::Mat mask(frame.size(), CV_8UC1, cv::Scalar(0));
  mask.colRange(0, 40).setTo(255);
  cv::imwrite((folder_ / "mask.png").string(), mask);
  const auto whole = List(video_, "whole"),
             part = List(video_, "part", {"--mask", (folder_ / "mask.png").string()});
  ASSERT_EQ(part.status, 0) << part.output;
  EXPECT_LT(SplitText(Listed("part"), "\n").size(), SplitText(Listed("whole"), "\n").size());
  cv::imwrite((folder_ / "mask.png").string(), mask.rowRange(0, 10));
  const auto wrong = List(video_, "wrong", {"--mask", (folder_ / "mask.png").string()});
  EXPECT_EQ(wrong.status, 1);
  EXPECT_THAT(wrong.output, HasSubstr("mask.png: the mask has"));
}

TEST_F(LoopsOfAVideo, NeedsOneThatCanBeRead) {
  testing::WriteAll(folder_ / "broken.avi", "no video");
  const auto run = List(folder_ / "broken.avi", "broken");
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, HasSubstr("broken.avi: can't be opened as a video"));
  const auto pairs = List(video_, "pairs", {"--join-pairs"});
  EXPECT_EQ(pairs.status, 1);
  EXPECT_THAT(pairs.output, HasSubstr("not frames of a video"));
}

}  // namespace
}  // namespace tutti
