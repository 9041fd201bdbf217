// `tutti loops` on a video.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "tests/apps/tutti/executable.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/test_data.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;

constexpr int kNewPlaces = 15, kVideoFrames = 20;

// Frames 15 to 19 show the places of 0 to 4 again.
class LoopsOfAVideo : public ::testing::Test {
 protected:
  void SetUp() override {
    cv::VideoWriter writer;
    for (int i = 0; i < kVideoFrames; ++i) {
      cv::Mat image = testing::TexturedImage(static_cast<std::uint32_t>(i % kNewPlaces));
      if (i >= kNewPlaces) image = testing::SeenAgain(image);
      if (image.channels() == 1) cv::cvtColor(image, image, cv::COLOR_GRAY2BGR);
      if (i == 0) writer.open(video_.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25, image.size());
      if (!writer.isOpened()) GTEST_SKIP() << "this OpenCV can't write a video";
      writer.write(image);
    }
  }

  testing::ProcessResult Loops(const fs::path& images, const std::string& out,
                               const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{"loops", images.string(), "--out", (folder_ / out).string(),
                                   "--set", "stm_size=3"};
    words.insert(words.end(), more.begin(), more.end());
    return RunTutti(words);
  }

  // Without the names of the images.
  std::string LoopsIn(const std::string& out) const {
    std::string text;
    for (const std::string& line : SplitText(ReadAll(folder_ / out / "loops.csv"), "\n"))
      text += line.substr(0, line.find(",\"")) + "\n";
    return text;
  }

  const fs::path folder_ = testing::FreshFolder(), video_ = folder_ / "walk.avi";
};

TEST_F(LoopsOfAVideo, AreThoseOfItsFrames) {
  cv::VideoCapture capture(video_.string());
  cv::Mat frame;
  fs::create_directories(folder_ / "frames");
  for (int i = 0; capture.read(frame); ++i)
    cv::imwrite((folder_ / "frames" / (std::to_string(i) + ".png")).string(), frame);
  const auto of_video = Loops(video_, "a"), of_frames = Loops(folder_ / "frames", "b");
  ASSERT_EQ(of_video.status, 0) << of_video.output;
  ASSERT_EQ(of_frames.status, 0) << of_frames.output;
  EXPECT_EQ(LoopsIn("a"), LoopsIn("b"));
  EXPECT_THAT(LoopsIn("a"), HasSubstr("\n17,2,"));
  EXPECT_THAT(ReadAll(folder_ / "a" / "loops.csv"), HasSubstr("\"frame 17\",\"frame 2\""));
  const cv::Mat a = cv::imread((folder_ / "a" / "contact_sheet.png").string());
  const cv::Mat b = cv::imread((folder_ / "b" / "contact_sheet.png").string());
  ASSERT_EQ(a.size(), b.size());
  const cv::Rect pictures(0, 84 + 84, a.cols, 240);  // the first strip's, without its words
  EXPECT_EQ(cv::norm(a(pictures), b(pictures), cv::NORM_L1), 0);
}

TEST_F(LoopsOfAVideo, MayBeOfEveryThirdFrame) {
  const auto run = Loops(video_, "third", {"--stride", "3"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_EQ(nlohmann::json::parse(ReadAll(folder_ / "third" / "results.json"))["images"], 7);
  EXPECT_THAT(ReadAll(folder_ / "third" / "hypotheses.csv"), HasSubstr("frame 18"));
}

TEST_F(LoopsOfAVideo, OrOfAFolderAreNotLookedForUnderAMask) {
  cv::VideoCapture capture(video_.string());
  cv::Mat frame;
  ASSERT_TRUE(capture.read(frame));
  cv::Mat mask(frame.size(), CV_8UC1, cv::Scalar(0));
  mask.colRange(0, 40).setTo(255);
  cv::imwrite((folder_ / "mask.png").string(), mask);
  const auto whole = Loops(video_, "whole"),
             part = Loops(video_, "part", {"--mask", (folder_ / "mask.png").string()});
  ASSERT_EQ(part.status, 0) << part.output;
  EXPECT_LT(SplitText(LoopsIn("part"), "\n").size(), SplitText(LoopsIn("whole"), "\n").size());
  cv::imwrite((folder_ / "mask.png").string(), mask.rowRange(0, 10));
  const auto wrong = Loops(video_, "wrong", {"--mask", (folder_ / "mask.png").string()});
  EXPECT_EQ(wrong.status, 1);
  EXPECT_THAT(wrong.output, HasSubstr("mask.png: the mask has"));
}

TEST_F(LoopsOfAVideo, NeedsOneThatCanBeRead) {
  testing::WriteAll(folder_ / "broken.avi", "no video");
  const auto run = Loops(folder_ / "broken.avi", "broken");
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, HasSubstr("broken.avi: can't be opened as a video"));
  const auto pairs = Loops(video_, "pairs", {"--join-pairs"});
  EXPECT_EQ(pairs.status, 1);
  EXPECT_THAT(pairs.output, HasSubstr("not frames of a video"));
}

}  // namespace
}  // namespace tutti
