// `tutti loops` on a folder that nobody has a ground truth for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/loops_fixture.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;

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
  const auto run = RunTutti({"loops", folder.string(), "--out", out.string(), "--set", "stm_size=3"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("loops accepted"));
  EXPECT_THAT(run.output, HasSubstr("loops.csv"));
  const std::string loops = ReadAll(out / "loops.csv");
  EXPECT_THAT(loops, HasSubstr("image,loop_with,probability,inliers,matches,late,file,loop_with_file\n"));
  EXPECT_THAT(loops, HasSubstr("\n17,2,"));
  EXPECT_THAT(loops, HasSubstr("\"17.png\",\"2.png\""));
  const nlohmann::json json = nlohmann::json::parse(ReadAll(out / "results.json"));
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
  const auto run = RunTutti({"loops", folder.string(), "--table", "--out", (folder / "out").string()});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, HasSubstr("--table compares rules by a ground truth"));
  EXPECT_FALSE(fs::exists(folder / "out"));
}

}  // namespace
}  // namespace tutti
