// Ground truth by overlap of `tutti loops`: poses and depth of the images' data set.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tutti/loops_fixture.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using testing::kLoopImages;
using testing::kLoopPlaces;
using testing::ReadAll;
using testing::WriteAll;

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
    std::vector<std::string> arguments = {"loops",
                                          (folder_ / "set").string(),
                                          "--rule",
                                          "orb",
                                          "--out",
                                          out_.string(),
                                          "--ground-truth-overlap",
                                          "0.3",
                                          "--ground-truth",
                                          (folder_ / "set" / "groundtruth.txt").string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return testing::RunTutti(arguments);
  }
};

TEST_F(LoopsByOverlap, APlaceIsWhatTwoImagesShare) {
  WriteDataset(folder_ / "set");
  const auto run = Loops({"--gt-camera", kCamera});
  ASSERT_EQ(run.status, 0) << run.output;
  ExpectAllFiles(out_);
  const nlohmann::json r = Json(out_ / "results.json");
  EXPECT_EQ(r["rows_with_loop"], 4) << "the fifth shares an eighth";
  std::vector<int> images;
  for (const auto& part : r["recall_by_overlap"]) images.push_back(part["images"].get<int>());
  EXPECT_EQ(images, (std::vector<int>{4, 4, 4, 3, 3}));
  EXPECT_EQ(r["recall_by_angle_deg"][0]["images"], 4);
  EXPECT_THAT(run.output, AllOf(HasSubstr("recall, overlap >= 0.5"), HasSubstr("of 3 images"),
                                HasSubstr(">= 30 % of one are seen in the other")));
  EXPECT_THAT(ReadAll(out_ / "recall_by_view.csv"), HasSubstr("verified,overlap,0.5,1,4,"));
  EXPECT_GT(PictureSize(out_ / "recall_by_view.png").area(), 100000);
  EXPECT_THAT(ReadAll(out_ / "hypotheses.csv"), HasSubstr(",late,reason"));
}

// Depth of the same images gives motions in metres: rigid in place of essential.
TEST_F(LoopsByOverlap, DepthGoesToTheDetectorIfWanted) {
  WriteDataset(folder_ / "set");
  const auto run = Loops({"--gt-camera", kCamera, "--rgbd", "--dump", "--set", "propose_threshold=0"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_THAT(ReadAll(out_ / "dump_verification.csv"), HasSubstr(",rigid,"));
}

TEST_F(LoopsByOverlap, WhatIsMissingIsNamedWithItsRemedy) {
  WriteDataset(folder_ / "set");
  const auto says = [&](const std::vector<std::string>& more, const std::string& what) {
    const auto run = Loops(more);
    EXPECT_EQ(run.status, 1) << run.output;
    EXPECT_THAT(run.output, HasSubstr(what));
  };
  says({}, "give --gt-camera");
  WriteImages();
  says({"--gt-camera", kCamera, "--gt-depth", images_.string()}, "RGB-D");
  WriteDataset(folder_ / "other", 12);
  says({"--gt-camera", kCamera, "--gt-depth", (folder_ / "other").string()}, "has no frame in");
  says({"--gt-camera", kCamera, "--gt-ignore-overlap", "0.5"}, "below which there is no loop");
  WriteAll(folder_ / "set" / "groundtruth.txt", ReadAll(Truth({})));
  says({"--gt-camera", kCamera}, "needs a pose for each image");
  fs::remove(folder_ / "set" / "depth.txt");
  says({"--gt-camera", kCamera}, "--gt-depth DATASET names another");
}

}  // namespace
}  // namespace tutti
