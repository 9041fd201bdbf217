// Runs of `tutti loops` on a few images.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tests/apps/tutti/executable.h"
#include "tests/loopclosure/features/textured_image.h"
#include "tests/support/test_data.h"
#include "tutti/core/text.h"

namespace tutti::testing {

constexpr int kEmptySheet = 84 + 340;  // height of a contact sheet with one strip [px]
constexpr int kLoopPlaces = 15, kLoopImages = 20;

// Images 15 to 19 show the places of 0 to 4 again.
inline cv::Mat LoopImage(int i) {
  const cv::Mat place = TexturedImage(static_cast<std::uint32_t>(i % kLoopPlaces));
  return i < kLoopPlaces ? place : SeenAgain(place);
}

class LoopsFixture : public ::testing::Test {
 protected:
  void WriteImages(int count = kLoopImages) const {
    std::filesystem::create_directories(images_);
    for (int i = 0; i < count; ++i)
      cv::imwrite((images_ / (std::to_string(i) + ".png")).string(), LoopImage(i));
  }
  // A matrix of `count` images with these (row, column) pairs as loops.
  std::filesystem::path Truth(const std::vector<std::pair<int, int>>& pairs, int count = kLoopImages) const {
    cv::Mat matrix = cv::Mat::zeros(count, count, CV_8U);
    for (const auto& [row, column] : pairs) matrix.at<std::uint8_t>(row, column) = 255;
    std::filesystem::path file = folder_ / "truth.png";
    cv::imwrite(file.string(), matrix);
    return file;
  }
  static std::vector<std::pair<int, int>> TruePairs() {
    std::vector<std::pair<int, int>> pairs;
    for (int i = kLoopPlaces; i < kLoopImages; ++i) pairs.emplace_back(i, i - kLoopPlaces);
    return pairs;
  }
  ProcessResult Run(const std::filesystem::path& truth, const std::filesystem::path& out,
                    const std::vector<std::string>& more = {}) const {
    return RunTutti(
        {"loops", "--images", images_.string(), "--ground-truth", truth.string(), "--out", out.string()},
        more);
  }
  // Without a ground truth, into a folder of that name; images are old from the third on.
  ProcessResult List(const std::filesystem::path& images, const std::string& out,
                     const std::vector<std::string>& more = {}) const {
    return RunTutti({"loops", images.string(), "--out", (folder_ / out).string(), "--set", "stm_size=3"},
                    more);
  }
  // The lines of loops.csv without the names of the images.
  std::string Listed(const std::string& out) const {
    std::string text;
    for (const std::string& line : SplitText(ReadAll(folder_ / out / "loops.csv"), "\n"))
      text += line.substr(0, line.find(",\"")) + "\n";
    return text;
  }
  static nlohmann::json Json(const std::filesystem::path& file) {
    return nlohmann::json::parse(ReadAll(file));
  }
  static cv::Size PictureSize(const std::filesystem::path& file) { return cv::imread(file.string()).size(); }
  static void ExpectAllFiles(const std::filesystem::path& out) {
    for (const char* name :
         {"results.json", "hypotheses.csv", "precision_recall.csv", "precision_recall.svg"})
      EXPECT_GT(ReadAll(out / name).size(), 50u) << name;
    for (const char* name : {"precision_recall.png", "confusion.png", "contact_sheet.png"})
      EXPECT_GT(PictureSize(out / name).area(), 100000) << name;
  }

  const std::filesystem::path folder_ = FreshFolder();
  const std::filesystem::path images_ = folder_ / "images", out_ = folder_ / "out";
};

}  // namespace tutti::testing
