// Ground truth of `tutti loops`, by matrix, poses or overlap, and the memory of an earlier run: whatever it
// is, each image counts as it should.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/loops_fixture.h"
#include "tutti/core/text.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::Done;
using testing::ExpectRefusal;
using ::testing::HasSubstr;
using testing::kEmptySheet;
using testing::kLoopImages;
using testing::kLoopPlaces;
using testing::ReadAll;
using testing::RunTutti;
using ::testing::StartsWith;
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
    Done(Run(folder_ / "truth.txt", out_, {"--rule", "orb", "--gt-exclude-s", "5"}));
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
    ExpectRefusal(Run(Truth({}, 7), out_, {flag}), {"7 x 7", "4 images"});
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
  Done(Run(Truth({}), out_));
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
  Done(Run(Truth(TruePairs()), out_));
  ExpectAllFiles(out_);
  const nlohmann::json r = Json(out_ / "results.json");
  EXPECT_EQ(r["images_damaged"], 5);
  EXPECT_EQ(r["rows_with_loop"], 5);
  EXPECT_EQ(r["at_default_threshold"]["recall"], 0);
  EXPECT_EQ(PictureSize(out_ / "contact_sheet.png").height, 84 + 5 * 340);
}

constexpr const char* kCamera = "160,160,159.5,119.5";

// TUM's layout: a plane 4 m away from 15 places, 20 m apart; images 15 to 19 are 0, 0, 0, 4 and 7 m beside 0
// to 4: 8 m are seen.
class LoopsByOverlap : public testing::LoopsFixture {
 protected:
  void WriteDataset(const fs::path& folder, int count = kLoopImages) const {
    fs::create_directories(folder / "rgb");
    fs::create_directories(folder / "depth");
    std::string rgb, depth, truth;
    const std::array<int, 5> beside = {0, 0, 0, 4, 7};
    for (int i = 0; i < count; ++i) {
      const std::string stamp = std::to_string(i) + ".000000", name = stamp + ".png";
      const cv::Mat image = testing::LoopImage(i);
      cv::imwrite((folder / "rgb" / name).string(), image);
      cv::imwrite((folder / "depth" / name).string(), cv::Mat(image.size(), CV_16UC1, cv::Scalar(4 * 5000)));
      rgb += stamp + " rgb/" + name + "\n";
      depth += stamp + " depth/" + name + "\n";
      const int x = 20 * (i % kLoopPlaces) + (i < kLoopPlaces ? 0 : beside[static_cast<std::size_t>(i - 15)]);
      truth += stamp + " " + std::to_string(x) + " 0 0 0 0 0 1\n";
    }
    WriteAll(folder / "rgb.txt", rgb);
    WriteAll(folder / "depth.txt", depth);
    WriteAll(folder / "groundtruth.txt", truth);
  }
  testing::ProcessResult Loops(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {"loops", folder_ / "set", "--rule", "orb", "--out", out_};
    arguments.insert(arguments.end(), {"--ground-truth-overlap", "0.3", "--ground-truth",
                                       folder_ / "set" / "groundtruth.txt"});
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::RunTutti(arguments);
  }
};

TEST_F(LoopsByOverlap, APlaceIsWhatTwoImagesShare) {
  WriteDataset(folder_ / "set");
  const std::string run = Done(Loops({"--gt-camera", kCamera}));
  ExpectAllFiles(out_);
  const nlohmann::json r = Json(out_ / "results.json");
  EXPECT_EQ(r["rows_with_loop"], 4) << "the fifth shares an eighth";
  std::vector<int> images;
  for (const auto& part : r["recall_by_overlap"]) images.push_back(part["images"].get<int>());
  EXPECT_EQ(images, (std::vector<int>{4, 4, 4, 3, 3}));
  EXPECT_EQ(r["recall_by_angle_deg"][0]["images"], 4);
  EXPECT_THAT(run, AllOf(HasSubstr("recall, overlap >= 0.5"), HasSubstr("of 3 images"),
                         HasSubstr(">= 30 % of one are seen in the other")));
  EXPECT_THAT(ReadAll(out_ / "recall_by_view.csv"), HasSubstr("verified,overlap,0.5,1,4,"));
  EXPECT_GT(PictureSize(out_ / "recall_by_view.png").area(), 100000);
  EXPECT_THAT(ReadAll(out_ / "hypotheses.csv"), HasSubstr(",late,reason"));
}

// Depth of the same images gives motions in metres: rigid in place of essential.
TEST_F(LoopsByOverlap, DepthGoesToTheDetectorIfWanted) {
  WriteDataset(folder_ / "set");
  Done(Loops({"--gt-camera", kCamera, "--rgbd", "--dump", "--set", "propose_threshold=0"}));
  EXPECT_THAT(ReadAll(out_ / "dump_verification.csv"), HasSubstr(",rigid,"));
}

TEST_F(LoopsByOverlap, WhatIsMissingIsNamedWithItsRemedy) {
  WriteDataset(folder_ / "set");
  const auto says = [&](const std::vector<std::string>& more, const std::string& what) {
    ExpectRefusal(Loops(more), {what});
  };
  says({}, "give --gt-camera");
  WriteImages();
  says({"--gt-camera", kCamera, "--gt-depth", images_}, "RGB-D");
  WriteDataset(folder_ / "other", 12);
  says({"--gt-camera", kCamera, "--gt-depth", folder_ / "other"}, "has no frame in");
  says({"--gt-camera", kCamera, "--gt-ignore-overlap", "0.5"}, "below which there is no loop");
  WriteAll(folder_ / "set" / "groundtruth.txt", ReadAll(Truth({})));
  says({"--gt-camera", kCamera}, "needs a pose for each image");
  fs::remove(folder_ / "set" / "depth.txt");
  says({"--gt-camera", kCamera}, "--gt-depth DATASET names another");
}

class LoopsMemory : public testing::LoopsFixture {};

TEST_F(LoopsMemory, ALaterRunWithTheSameMemoryFindsLoopsIntoTheImagesOfTheFirst) {
  WriteImages(kLoopPlaces);
  constexpr int kAgain = 4;
  const fs::path later = folder_ / "later";
  fs::create_directories(later);
  for (int i = 0; i < kAgain; ++i)
    cv::imwrite((later / (std::to_string(i) + ".png")).string(),
                testing::SeenAgain(testing::TexturedImage(static_cast<std::uint32_t>(i))));
  const fs::path memory = folder_ / "memory", out = folder_ / "later_out";
  const std::vector<std::vector<std::string>> ways = {{"--set", "ltm_file=" + memory.string() + ".ltm"},
                                                      {"--places", memory.string() + ".places"}};
  for (const std::vector<std::string>& way : ways) {
    ASSERT_EQ(Run(Truth({}, kLoopPlaces), out_, way).status, 0);
    EXPECT_FALSE(fs::exists(out_ / "earlier_loops.csv"));
    const auto go_on = [&] {
      return RunTutti({"loops", "--images", later, "--ground-truth", Truth({}, kAgain).string(), "--out", out,
                       way[0], way[1]});
    };
    EXPECT_THAT(Done(go_on()), HasSubstr("4 images, into 15"));
    const nlohmann::json json = Json(out / "results.json");
    EXPECT_EQ(json["earlier"]["images"], kLoopPlaces);
    EXPECT_EQ(json["earlier"]["loops"], kAgain);
    EXPECT_EQ(json["images"], kAgain);
    EXPECT_EQ(json["accepted"]["false"], 0) << "the ground truth does not know the earlier images";
    const std::vector<std::string> lines = SplitText(ReadAll(out / "earlier_loops.csv"), "\n");
    ASSERT_EQ(lines.size(), 1u + kAgain);
    for (int i = 0; i < kAgain; ++i) {
      const std::string name = std::to_string(i) + ".png";
      EXPECT_THAT(lines[static_cast<std::size_t>(i) + 1],
                  StartsWith(std::to_string(i) + ",\"" + name + "\"," + std::to_string(i) + ",\"" +
                             (images_ / name).string() + "\","));
    }
    EXPECT_THAT(ReadAll(out / "hypotheses.csv"), HasSubstr((images_ / "0.png").string()));
    ASSERT_EQ(go_on().status, 0);
    EXPECT_EQ(Json(out / "results.json")["earlier"]["images"], kLoopPlaces + kAgain) << "numbers go on";
  }
}

TEST_F(LoopsMemory, AMemoryThatIsOfNoUseIsNamed) {
  WriteImages(3);
  const std::string memory = (folder_ / "memory.ltm").string(), set = "ltm_file=" + memory;
  const fs::path truth = Truth({}, 3);
  ExpectRefusal(Run(truth, out_, {"--set", set, "--table"}), {memory, "--table"});
  ASSERT_EQ(Run(truth, out_, {"--set", set}).status, 0);
  ExpectRefusal(Run(truth, out_, {"--set", set, "--rule", "orb"}), {memory, "another configuration"});
  WriteAll(memory + ".images.csv", "image,file\nthree,x.png\n");
  ExpectRefusal(Run(truth, out_, {"--set", set}), {memory + ".images.csv:2"});
  fs::remove(memory + ".images.csv");
  EXPECT_EQ(Run(truth, out_, {"--set", set}).status, 0) << "without names";
}

}  // namespace
}  // namespace tutti
