// `tutti loops` on a bag of ROS, a video, pairs of images, and on a folder without ground truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <string>

#include "data/synthetic/synthetic_world.h"
#include "tests/apps/tutti/executable.h"
#include "tests/apps/tutti/loops_fixture.h"
#include "tests/support/bag_writer.h"
#include "tests/support/matroska_writer.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::ReadAll;
using testing::RunTutti;
using testing::WriteAll;

double StampOfFrame(int i) { return 1500 + 0.5 * i; }

class LoopsOfABag : public testing::LoopsFixture {
 protected:
  void SetUp() override {
    WriteImages();
    const std::string type = "sensor_msgs/Image";
    testing::BagWriter one, two;
    for (int i = 0; i < testing::kLoopImages; ++i) {
      const cv::Mat image = testing::LoopImage(i);
      const std::string message =
          testing::ImageMessage(image, image.channels() == 3 ? "bgr8" : "mono8", StampOfFrame(i));
      one.Write("/left/image", type, message);
      two.Write("/left/image", type, message);
      two.Write("/right/image", type, message);
    }
    testing::WriteAll(folder_ / "one.bag", one.Finish());
    testing::WriteAll(folder_ / "two.bag", two.Finish());
  }
};

TEST_F(LoopsOfABag, AreThoseOfItsImages) {
  const auto of_bag = List(folder_ / "one.bag", "a"), of_images = List(images_, "b");
  ASSERT_EQ(of_bag.status, 0) << of_bag.output;
  ASSERT_EQ(of_images.status, 0) << of_images.output;
  EXPECT_THAT(of_bag.output, Not(HasSubstr("no calibration"))) << "loops need none";
  EXPECT_EQ(Listed("a"), Listed("b"));
  EXPECT_THAT(Listed("a"), HasSubstr("\n17,2,"));
  EXPECT_THAT(ReadAll(folder_ / "a" / "loops.csv"), HasSubstr("\"frame 17\",\"frame 2\""));
}

TEST_F(LoopsOfABag, AreOfTheTopicThatIsNamed) {
  ExpectRefusal(List(folder_ / "two.bag", "which"), {"Set --topic to one of: /left/image /right/image"});
  const auto right = List(folder_ / "two.bag", "right", {"--topic", "/right/image"});
  EXPECT_EQ(right.status, 0) << right.output;
  EXPECT_THAT(Listed("right"), HasSubstr("\n17,2,"));
  ExpectRefusal(List(images_, "images_out", {"--topic", "/right/image"}),
                {"is no bag of ROS; leave --topic out"});
}

// A trajectory need not have a pose at each.
TEST_F(LoopsOfABag, AreJudgedByTheStampsOfItsMessages) {
  std::string poses;
  for (int i = 0; i < testing::kLoopImages; ++i) {
    if (i == 7) continue;
    poses += std::to_string(StampOfFrame(i)) + " " + std::to_string(100 * (i % testing::kLoopPlaces)) +
             " 0 0 0 0 0 1\n";
  }
  testing::WriteAll(folder_ / "poses.txt", poses);
  Done(List(folder_ / "one.bag", "judged", {"--ground-truth", folder_ / "poses.txt", "--gt-exclude-s", "3"}));
  const std::string results = ReadAll(folder_ / "judged" / "results.json");
  EXPECT_THAT(results, HasSubstr("of 1 images it says nothing"));
  testing::WriteAll(folder_ / "poses.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n");
  ExpectRefusal(List(folder_ / "one.bag", "other", {"--ground-truth", folder_ / "poses.txt"}),
                {"their time stamps are not among its"});
}

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
  Done(List(video_, "third", {"--stride", "3"}));
  EXPECT_EQ(testing::ReadJson(folder_ / "third" / "results.json")["images"], 7);
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
  const std::string run = Done(
      List(folder_ / "walk.mkv", "judged", {"--ground-truth", folder_ / "poses.txt", "--gt-exclude-s", "5"}));
  EXPECT_EQ(Json(folder_ / "judged" / "results.json")["rows_with_loop"], 5) << run;
}

TEST_F(LoopsOfAVideo, OrOfAFolderAreNotLookedForUnderAMask) {
  cv::VideoCapture capture(video_.string());
  cv::Mat frame;
  ASSERT_TRUE(capture.read(frame));
  cv::Mat mask(frame.size(), CV_8UC1, cv::Scalar(0));
  mask.colRange(0, 40).setTo(255);
  cv::imwrite((folder_ / "mask.png").string(), mask);
  const auto whole = List(video_, "whole"), part = List(video_, "part", {"--mask", folder_ / "mask.png"});
  ASSERT_EQ(part.status, 0) << part.output;
  EXPECT_LT(SplitText(Listed("part"), "\n").size(), SplitText(Listed("whole"), "\n").size());
  cv::imwrite((folder_ / "mask.png").string(), mask.rowRange(0, 10));
  ExpectRefusal(List(video_, "wrong", {"--mask", folder_ / "mask.png"}), {"mask.png: the mask has"});
}

TEST_F(LoopsOfAVideo, NeedsOneThatCanBeRead) {
  testing::WriteAll(folder_ / "broken.avi", "no video");
  ExpectRefusal(List(folder_ / "broken.avi", "broken"), {"broken.avi: can't be opened as a video"});
  ExpectRefusal(List(video_, "pairs", {"--join-pairs"}), {"not frames of a video"});
}

constexpr int kPairs = 14;

// A few pairs of small images that look to both sides of a street.
std::filesystem::path SidesOfAStreet() {
  SyntheticOptions options;
  options.sensor = SyntheticSensor::kSides;
  options.width = 160;
  options.height = 120;
  options.rate_hz = 2;
  options.frames = kPairs;
  options.supersample = 1;
  std::filesystem::path folder = testing::FreshFolder() / "sides";
  WriteSyntheticDataset(SyntheticWorld(options), folder);
  return folder;
}

// A text matrix without loops.
std::string Zeros(int size) {
  std::string row;
  for (int i = 0; i < size; ++i) row += "0 ";
  std::string text;
  for (int i = 0; i < size; ++i) text += row + "\n";
  return text;
}

TEST(LoopsPairs, JoinsPairsAndTakesTruthOfPairsOrOfSingleImages) {
  const std::filesystem::path folder = SidesOfAStreet();
  WriteAll(folder / "pairs.txt", Zeros(kPairs));
  WriteAll(folder / "singles.txt", Zeros(2 * kPairs));
  for (const char* truth : {"poses.txt", "pairs.txt", "singles.txt"}) {
    const auto out = folder / "out";
    Done(RunTutti({"loops", "--images", folder / "images", "--join-pairs", "--ground-truth", folder / truth,
                   "--rule", "orb", "--out", out}));
    const auto json = testing::ReadJson(out / "results.json");
    EXPECT_EQ(json["images"], kPairs) << truth;
    EXPECT_EQ(json["images_damaged"], 0);
    EXPECT_FALSE(std::filesystem::exists(out / "posteriors.csv"));
  }
}

TEST(LoopsPairs, KeepPosteriorWritesWhatEachMemberBelieves) {
  const std::filesystem::path folder = SidesOfAStreet();
  Done(RunTutti({"loops", "--images", folder / "images", "--join-pairs", "--ground-truth",
                 folder / "poses.txt", "--keep-posterior", "--out", folder / "out"}));
  const std::string csv = ReadAll(folder / "out/posteriors.csv");
  EXPECT_THAT(csv, HasSubstr("image,location,truth,combined,surf,sift,orb\n"));
  // Ten images are in short-term memory: the twelfth is the first with a candidate other than the first
  // image.
  EXPECT_THAT(csv, HasSubstr("\n11,1,"));
}

TEST(LoopsPairs, AnOddNumberOfImagesCanNotBeJoined) {
  const std::filesystem::path folder = SidesOfAStreet();
  std::filesystem::remove(folder / "images/000005.png");
  ExpectRefusal(RunTutti({"loops", "--images", folder / "images", "--join-pairs", "--ground-truth",
                          folder / "poses.txt", "--out", folder / "out"}),
                {"27 images", "--join-pairs"});
}

constexpr int kImages = testing::kLoopImages;

// KITTI's layout, with a picture beside the images.
fs::path DriveWithLoops() {
  fs::path folder = testing::FreshFolder() / "drive";
  fs::create_directories(folder / "image_0");
  cv::imwrite((folder / "loop_matrix.png").string(), cv::Mat(kImages, kImages, CV_8UC1, cv::Scalar(0)));
  for (int i = 0; i < kImages; ++i)
    cv::imwrite((folder / "image_0" / (std::to_string(i) + ".png")).string(), testing::LoopImage(i));
  return folder;
}

TEST(LoopsWithoutTruth, AreListedAndShownButNotJudged) {
  const fs::path folder = DriveWithLoops(), out = folder / "out";
  const std::string run = Done(RunTutti({"loops", folder, "--out", out, "--set", "stm_size=3"}));
  EXPECT_THAT(run, HasSubstr("loops accepted"));
  EXPECT_THAT(run, HasSubstr("loops.csv"));
  const std::string loops = ReadAll(out / "loops.csv");
  EXPECT_THAT(loops, HasSubstr("image,loop_with,probability,inliers,matches,late,file,loop_with_file\n"));
  EXPECT_THAT(loops, HasSubstr("\n17,2,"));
  EXPECT_THAT(loops, HasSubstr("\"17.png\",\"2.png\""));
  const nlohmann::json json = testing::ReadJson(out / "results.json");
  EXPECT_TRUE(json["protocol"]["ground_truth"].is_null());
  EXPECT_EQ(json["images"], kImages);
  EXPECT_GE(json["accepted"].get<int>(), 3);
  EXPECT_FALSE(json.contains("recall_at_100_precision"));
  EXPECT_FALSE(fs::exists(out / "precision_recall.csv"));
  const int strips = json["accepted"].get<int>();
  EXPECT_EQ(cv::imread((out / "contact_sheet.png").string()).rows, 84 + 340 * strips);
}

TEST(LoopsWithoutTruth, CantBeATable) {
  const fs::path folder = DriveWithLoops();
  ExpectRefusal(RunTutti({"loops", folder, "--table", "--out", folder / "out"}),
                {"--table compares rules by a ground truth"});
  EXPECT_FALSE(fs::exists(folder / "out"));
}

}  // namespace
}  // namespace tutti
