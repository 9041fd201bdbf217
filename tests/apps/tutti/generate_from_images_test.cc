// `tutti generate`, as a user runs it, most of all --from-images.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;
using testing::WriteAll;

// Six images with a pattern, grey and colour, named by time stamps of different length.
fs::path SixImages(const cv::Size& size = {64, 48}) {
  fs::path folder = testing::FreshFolder() / "from";
  fs::create_directories(folder);
  for (int i = 0; i < 6; ++i) {
    cv::Mat image(size, i % 2 == 0 ? CV_8UC1 : CV_8UC3);
    cv::RNG random(static_cast<std::uint64_t>(i) + 1);
    random.fill(image, cv::RNG::UNIFORM, 0, 256);
    cv::imwrite((folder / (std::to_string(8 + i) + ".5.bmp")).string(), image);
  }
  WriteAll(folder / "notes.txt", "no image");
  return folder;
}

TEST(GenerateFromImages, KeepsTheNamesAndCopiesImagesBeforeChangeFromByteForByte) {
  const fs::path from = SixImages(), out = from.parent_path() / "out";
  EXPECT_THAT(Done(RunTutti({"generate", "--from-images", from, "--out", out, "--change", "dark:2",
                             "--change-from", "2", "--threads", "2"})),
              HasSubstr("6 images, changed by dark:2 from image 2 on"));
  for (const char* name : {"8.5.bmp", "9.5.bmp"}) EXPECT_EQ(ReadAll(out / name), ReadAll(from / name));
  for (const char* stem : {"10.5", "11.5", "12.5", "13.5"}) {
    const cv::Mat changed = cv::imread((out / stem).string() + ".png", cv::IMREAD_UNCHANGED);
    const cv::Mat before = cv::imread((from / stem).string() + ".bmp", cv::IMREAD_UNCHANGED);
    ASSERT_EQ(changed.type(), before.type()) << stem;
    EXPECT_LT(cv::mean(changed)[0], 0.4 * cv::mean(before)[0]) << stem;
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(out), {}), 6);
}

TEST(GenerateFromImages, TakesEveryNthAndDoesNotDependOnThreads) {
  const fs::path from = SixImages(), root = from.parent_path();
  for (const char* threads : {"1", "3"}) {
    Done(RunTutti({"generate", "--from-images", from, "--out", root / threads, "--change", "rain", "--stride",
                   "2", "--threads", threads}));
    EXPECT_EQ(std::distance(fs::directory_iterator(root / threads), {}), 3);
  }
  for (const char* name : {"8.5.png", "10.5.png", "12.5.png"}) {
    EXPECT_EQ(ReadAll(root / "1" / name), ReadAll(root / "3" / name)) << name;
  }
}

TEST(GenerateFromImages, APictureOfAnotherTypeIsNoImageAsForTheOtherCommands) {
  const fs::path folder = testing::FreshFolder(), from = folder / "from";
  fs::create_directories(from);
  cv::Mat image(48, 64, CV_8UC1);
  cv::randu(image, 0, 256);
  for (int i = 1; i <= 11; ++i) cv::imwrite((from / (std::to_string(i) + ".jpg")).string(), image);
  cv::imwrite((from / "ground_truth.bmp").string(), image);
  EXPECT_THAT(
      Done(RunTutti({"generate", "--from-images", from, "--out", folder / "out", "--change", "dark"})),
      AllOf(HasSubstr("11 images, changed"), HasSubstr("1 .bmp image(s) among 12")));
  const auto loops = RunTutti({"loops", from, "--out", folder / "loops"});
  EXPECT_EQ(loops.status, 0) << loops.output;
  EXPECT_THAT(loops.output, HasSubstr("1 .bmp image(s) among 12"));
  EXPECT_THAT(ReadAll(folder / "loops" / "loops.csv"), ::testing::Not(HasSubstr("ground_truth")));
}

TEST(GenerateFromImages, WhatAThermalCameraSeesIsStretched) {
  const fs::path folder = testing::FreshFolder(), from = folder / "from";
  fs::create_directories(from);
  cv::Mat image(48, 64, CV_16UC1);
  cv::randu(image, 7000, 7200);
  for (int i = 0; i < 3; ++i) cv::imwrite((from / (std::to_string(i) + ".png")).string(), image);
  Done(RunTutti({"generate", "--from-images", from, "--out", folder / "out", "--change", "rain"}));
  cv::Scalar mean, deviation;
  cv::meanStdDev(cv::imread((folder / "out" / "1.png").string(), cv::IMREAD_GRAYSCALE), mean, deviation);
  EXPECT_GT(deviation[0], 20) << "7000 to 7200 of 65536 is one grey value";
}

TEST(GenerateFromImages, OnePixelIsEnough) {
  const fs::path from = SixImages({1, 1});
  Done(
      RunTutti({"generate", "--from-images", from, "--out", from.parent_path() / "out", "--change", "roll"}));
}

TEST(GenerateFromImages, WhatCanNotBeDoneIsSaidBeforeAnythingIsWritten) {
  const fs::path from = SixImages(), out = from.parent_path() / "out", empty = from.parent_path() / "empty";
  fs::create_directories(empty);
  const auto refused = [&](const std::vector<std::string>& more) {
    std::vector<std::string> all = {"generate", "--out", out};
    all.insert(all.end(), more.begin(), more.end());
    const auto run = RunTutti(all);
    EXPECT_GT(run.status, 0);
    EXPECT_LT(run.status, 128);
    EXPECT_FALSE(fs::exists(out));
    return run.output;
  };
  EXPECT_THAT(refused({"--from-images", from, "--change", "ocluded:2"}),
              HasSubstr("did you mean 'occluded'?"));
  EXPECT_THAT(refused({"--from-images", from, "--change", "dark:9"}), HasSubstr("1 (mild) or 2 (strong)"));
  EXPECT_THAT(refused({"--from-images", empty, "--change", "dark"}), HasSubstr("holds no image files"));
  EXPECT_THAT(refused({"--from-images", empty / "no", "--change", "dark"}), HasSubstr("no such folder"));
  EXPECT_THAT(refused({"--from-images", from, "--change", "dark", "--stride", "0"}), HasSubstr("--stride"));
  EXPECT_THAT(refused({"--from-images", from}), HasSubstr("--change"));
  EXPECT_THAT(refused({"--from-images", from, "--change", "dark", "--laps", "2"}), HasSubstr("--laps"));
  EXPECT_THAT(refused({}), HasSubstr("--sensor"));
  fs::copy_file(from / "8.5.bmp", from / "8.5.png");
  EXPECT_THAT(refused({"--from-images", from, "--change", "dark"}), HasSubstr("another ending"));
}

TEST(GenerateFromImages, NeverWritesIntoTheFolderItReadsFrom) {
  const fs::path from = SixImages();
  ExpectRefusal(RunTutti({"generate", "--from-images", from, "--out", from, "--change", "dark", "--force"}),
                {"give another folder"});
  EXPECT_TRUE(fs::exists(from / "8.5.bmp"));
}

TEST(GenerateFromImages, ADamagedImageIsNamed) {
  const fs::path from = SixImages();
  WriteAll(from / "10.5.bmp", "BM, but no more");
  ExpectRefusal(
      RunTutti({"generate", "--from-images", from, "--out", from.parent_path() / "out", "--change", "blur"}),
      {"10.5.bmp"});
}

TEST(GenerateFromImages, ForceRemovesTheOldImagesAndNoOthers) {
  const fs::path from = SixImages(), out = from.parent_path() / "out";
  fs::create_directories(out);
  WriteAll(out / "8.5.bmp", "old");
  WriteAll(out / "keep.txt", "mine");
  std::vector<std::string> arguments = {"generate", "--from-images", from, "--out", out, "--change", "jpeg"};
  EXPECT_NE(RunTutti(arguments).status, 0);
  arguments.emplace_back("--force");
  EXPECT_EQ(RunTutti(arguments).status, 0);
  EXPECT_FALSE(fs::exists(out / "8.5.bmp"));
  EXPECT_TRUE(fs::exists(out / "8.5.png"));
  EXPECT_TRUE(fs::exists(out / "keep.txt"));
  WriteAll(out / "99.png", "mine");
  ExpectRefusal(RunTutti(arguments), {"99.png: was not made from"});
  EXPECT_EQ(ReadAll(out / "99.png"), "mine");
  EXPECT_TRUE(fs::exists(out / "8.5.png"));
}

TEST(Generate, WhatASignalInterruptsCanBeUsed) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    const fs::path out = testing::FreshFolder() / "town";
    const auto run =
        testing::RunTuttiAndSignal({"generate", "--out", out, "--sensor", "mono", "--frames", "400",
                                    "--width", "320", "--height", "160", "--threads", "2"},
                                   "generate ", signal);
    EXPECT_EQ(run.status, 130) << run.output;
    EXPECT_THAT(run.output, AllOf(HasSubstr("interrupted"), HasSubstr("of 400 frames and can be used")));
    const auto images = std::distance(fs::directory_iterator(out / "image_0"), {});
    const std::string poses = ReadAll(out / "poses.txt");
    EXPECT_EQ(std::count(poses.begin(), poses.end(), '\n'), images);
    EXPECT_LT(images, 400);
  }
}

}  // namespace
}  // namespace tutti
