// Ground truth of `tutti loops`: whatever it is, each image counts as it should.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/loops_fixture.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::kEmptySheet;
using testing::kLoopImages;
using testing::ReadAll;
using testing::WriteAll;

class LoopsGroundTruth : public testing::LoopsFixture {};

TEST_F(LoopsGroundTruth, ImagesWithoutAPoseAreIgnoredWhereNamesAreTimeStamps) {
  fs::create_directories(images_);
  std::string truth;
  for (int i = 0; i < 16; ++i) {  // two laps of 8 places
    const std::string stamp = std::to_string(100 + i) + ".0";
    cv::imwrite((images_ / (stamp + ".png")).string(),
                testing::TexturedImage(static_cast<std::uint32_t>(i % 8)));
    const std::string x = std::to_string(20 * (i % 8));
    if (i > 0) truth.append(stamp).append(" ").append(x).append(" 0 0 0 0 0 1\n");
  }
  const auto loops = [&](const std::string& first) {
    WriteAll(folder_ / "truth.txt", first + truth);
    const auto run = Run(folder_ / "truth.txt", out_, {"--rule", "orb", "--gt-exclude-s", "5"});
    EXPECT_EQ(run.status, 0) << run.output;
    return Json(out_ / "results.json");
  };
  const nlohmann::json whole = loops("100.0 0 0 0 0 0 0 1\n");
  EXPECT_EQ(whole["rows_with_loop"], 8);
  const nlohmann::json near = loops("100.4 0 0 0 0 0 0 1\n100.45 0 0 0 0 0 0 1\n");
  EXPECT_EQ(near["rows_with_loop"], 8) << "0.4 s is less than half a frame";
  const nlohmann::json without = loops("");
  EXPECT_EQ(without["rows_with_loop"], 7);
  EXPECT_THAT(without["protocol"]["ground_truth"].get<std::string>(),
              HasSubstr("of 1 images it says nothing"));
}

TEST_F(LoopsGroundTruth, GroundTruthOfAnotherSizeNamesBothSizes) {
  WriteImages(4);
  for (const char* flag : {"--table", "--rule=mean"}) {
    const auto run = Run(Truth({}, 7), out_, {flag});
    EXPECT_EQ(run.status, 1);
    EXPECT_THAT(run.output, AllOf(HasSubstr("7 x 7"), HasSubstr("4 images")));
  }
}

TEST_F(LoopsGroundTruth, TransposedGroundTruthIsTheSameGroundTruth) {
  WriteImages();
  ASSERT_EQ(Run(Truth(TruePairs()), out_).status, 0);
  std::vector<std::pair<int, int>> transposed;
  for (const auto& [row, column] : TruePairs()) transposed.emplace_back(column, row);
  ASSERT_EQ(Run(Truth(transposed), folder_ / "transposed").status, 0);
  EXPECT_EQ(ReadAll(out_ / "hypotheses.csv"), ReadAll(folder_ / "transposed" / "hypotheses.csv"));
  EXPECT_EQ(ReadAll(out_ / "precision_recall.csv"), ReadAll(folder_ / "transposed" / "precision_recall.csv"));
}

TEST_F(LoopsGroundTruth, NoLoopInTheGroundTruthMakesEveryAcceptedOneFalse) {
  WriteImages();
  const auto run = Run(Truth({}), out_);
  ASSERT_EQ(run.status, 0) << run.output;
  ExpectAllFiles(out_);
  const nlohmann::json r = Json(out_ / "results.json");
  EXPECT_EQ(r["rows_with_loop"], 0);
  EXPECT_EQ(r["recall_at_100_precision"], 0);
  EXPECT_GT(r["accepted"]["false"].get<int>(), 1);
  EXPECT_THAT(ReadAll(out_ / "precision_recall.svg"), HasSubstr("the ground truth has no loop"));
  EXPECT_GT(PictureSize(out_ / "contact_sheet.png").height, kEmptySheet);
}

TEST_F(LoopsGroundTruth, BlankAndDamagedImagesMissEveryLoopButStayInTheDenominator) {
  fs::create_directories(images_);
  for (int i = 0; i < kLoopImages; ++i) {
    const fs::path file = images_ / (std::to_string(i) + ".png");
    if (i % 4 == 3) {
      WriteAll(file, "not an image");
    } else {
      cv::imwrite(file.string(), cv::Mat(120, 160, CV_16UC1, cv::Scalar(900)));
    }
  }
  const auto run = Run(Truth(TruePairs()), out_);
  ASSERT_EQ(run.status, 0) << run.output;
  ExpectAllFiles(out_);
  const nlohmann::json r = Json(out_ / "results.json");
  EXPECT_EQ(r["images_damaged"], 5);
  EXPECT_EQ(r["rows_with_loop"], 5);
  EXPECT_EQ(r["at_default_threshold"]["recall"], 0);
  EXPECT_EQ(PictureSize(out_ / "contact_sheet.png").height, 84 + 5 * 340);
}

}  // namespace
}  // namespace tutti
