// `tutti run` with a part of the images, and with images that are not upright.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/apps/tiny_town.h"
#include "tests/apps/tutti/executable.h"
#include "tests/support/test_data.h"
#include "tutti/core/trajectory.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::ReadAll;
using testing::RunTutti;

constexpr int kHidden = 90;  // rows of 240

// A town whose lowest rows show the same in every image.
class ImageUse : public ::testing::Test {
 protected:
  fs::path Painted() const {
    fs::path town = testing::CopyOfTinyTown(folder_ / "painted");
    cv::RNG random(7);
    cv::Mat pattern(kHidden / 3, 160, CV_8UC1), large;
    random.fill(pattern, cv::RNG::UNIFORM, 0, 256);
    cv::repeat(pattern, 3, 3, large);
    for (const char* camera : {"image_0", "image_1"}) {
      for (const auto& entry : fs::directory_iterator(town / camera)) {
        cv::Mat image = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
        large.copyTo(image.rowRange(image.rows - kHidden, image.rows));
        cv::imwrite(entry.path().string(), image);
      }
    }
    return town;
  }
  fs::path Mask() const {
    cv::Mat mask(240, 480, CV_8UC1, cv::Scalar(255));
    mask.rowRange(240 - kHidden, 240).setTo(0);
    cv::imwrite((folder_ / "mask.png").string(), mask);
    return folder_ / "mask.png";
  }
  testing::ProcessResult Run(const fs::path& town, const std::string& out,
                             const std::vector<std::string>& more) const {
    std::vector<std::string> words{"run", town.string(), "--out", (folder_ / out).string(), "--no-report"};
    words.insert(words.end(), more.begin(), more.end());
    return RunTutti(words);
  }
  nlohmann::json Summary(const std::string& out) const {
    return nlohmann::json::parse(ReadAll(folder_ / out / "summary.json"));
  }
  const fs::path folder_ = testing::FreshFolder();
};

TEST_F(ImageUse, WhatTheMaskHidesDoesNotStopTheCamera) {
  const fs::path town = Painted();
  const auto masked = Run(town, "masked", {"--mask", Mask().string()});
  ASSERT_EQ(masked.status, 0) << masked.output;
  EXPECT_EQ(Summary("masked")["frames"]["tracked"], testing::kTinyFrames);
  EXPECT_EQ(Summary("masked")["frames"]["without_mask"], 0);
  EXPECT_LT(Summary("masked")["evaluation"]["slam"]["ate_rmse_m"].get<double>(), 0.3);
  EXPECT_EQ(Summary("masked")["config"]["dataset"]["mask"], (folder_ / "mask.png").string());
}

TEST_F(ImageUse, ImagesWithoutAMaskAreUsedWholeAndCounted) {
  fs::create_directories(folder_ / "masks");
  fs::copy(Mask(), folder_ / "masks" / "000002.png");
  fs::copy(Mask(), folder_ / "masks" / "000003.png");
  const auto run = Run(testing::TinyTown(), "out", {"--mask", (folder_ / "masks").string(), "--end", "10"});
  ASSERT_EQ(run.status, 0) << run.output;
  EXPECT_EQ(Summary("out")["frames"]["without_mask"], 8);
  EXPECT_THAT(run.output, HasSubstr("28 of 30 images have no mask"));
  EXPECT_THAT(run.output, HasSubstr("8 without mask"));
}

TEST_F(ImageUse, AMaskThatCantBeIsToldBeforeTheRun) {
  cv::imwrite((folder_ / "small.png").string(), cv::Mat(10, 10, CV_8UC1, cv::Scalar(255)));
  const auto run = Run(testing::TinyTown(), "out", {"--mask", (folder_ / "small.png").string()});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, HasSubstr("small.png: the mask has 10x10 pixels, but the images have 480x240"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(ImageUse, ImagesThatLieOnTheirSideAreTurnedUpright) {
  const fs::path lying = testing::CopyOfTinyTown(folder_ / "lying");
  for (const auto& entry : fs::directory_iterator(lying / "image_0")) {
    cv::Mat image = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    cv::rotate(image, image, cv::ROTATE_90_COUNTERCLOCKWISE);
    cv::imwrite(entry.path().string(), image);
  }
  const std::vector<std::string> upright{"--sensor",   "mono",  "--camera", "240,240,230,120",
                                         "--no-loops", "--end", "15"};
  const std::vector<std::string> turned{
      "--sensor", "mono", "--camera", "240,240,120,249", "--no-loops", "--end", "15", "--rotate", "90"};
  const auto a = Run(testing::TinyTown(), "a", upright), b = Run(lying, "b", turned);
  ASSERT_EQ(a.status, 0) << a.output;
  ASSERT_EQ(b.status, 0) << b.output;
  const Trajectory first = ReadTrajectory(folder_ / "a" / "trajectory.txt", TrajectoryFormat::kTum);
  const Trajectory second = ReadTrajectory(folder_ / "b" / "trajectory.txt", TrajectoryFormat::kTum);
  ASSERT_EQ(first.size(), second.size());
  ASSERT_GT(first.size(), 5u);
  const double turn = 0.5 * 3.14159265358979323846;
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_NEAR((first[i].pose.translation - second[i].pose.translation).norm(), 0, 1e-5);
    // The body is the camera as it lay.
    EXPECT_NEAR(first[i].pose.rotation.angularDistance(second[i].pose.rotation), turn, 1e-5);
  }
  EXPECT_EQ(Summary("b")["config"]["dataset"]["rotate"], 90);
}

TEST_F(ImageUse, PairsAreNotTurned) {
  const auto run = Run(testing::TinyTown(), "out", {"--rotate", "90"});
  EXPECT_EQ(run.status, 1);
  EXPECT_THAT(run.output, HasSubstr("stereo pairs can't be turned"));
  const auto odd = Run(testing::TinyTown(), "out", {"--rotate", "45"});
  EXPECT_EQ(odd.status, 1);
  EXPECT_THAT(odd.output, HasSubstr("90, 180, 270"));
}

}  // namespace
}  // namespace tutti
