// Colour images of data sets: the pixels of the grey ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "tests/frontend/dataset/dataset_files.h"
#include "tests/support/test_data.h"
#include "tutti/frontend/dataset.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using testing::Difference;
using ::testing::HasSubstr;

// Blue grows to the right, green downwards, red with the number.
cv::Mat Colourful(int number) {
  cv::Mat image(48, 64, CV_8UC3);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x)
      image.at<cv::Vec3b>(y, x) = {static_cast<unsigned char>(3 * x), static_cast<unsigned char>(4 * y),
                                   static_cast<unsigned char>(40 * number)};
  }
  return image;
}

DatasetOptions ColourOptions() { return testing::With(Sensor::kMono, true); }

fs::path FolderOfThree() {
  fs::path folder = testing::FreshFolder();
  for (int i = 0; i < 3; ++i) testing::WriteImage(folder / (std::to_string(i) + ".png"), Colourful(i));
  return folder;
}

TEST(ReadColour, HasTheColoursOfTheFile) {
  const auto dataset = OpenDataset(FolderOfThree(), ColourOptions());
  for (int i = 0; i < 3; ++i) {
    const ColourImage read = dataset->ReadColour(static_cast<std::size_t>(i));
    ASSERT_EQ(read.error, "");
    EXPECT_EQ(Difference(read.image, Colourful(i)), 0.0);
  }
}

TEST(ReadColour, IsRectifiedAsTheGreyImageIs) {
  DatasetOptions options = ColourOptions();
  options.camera->distortion = Distortion::kRadTan;
  options.camera->coefficients = {-0.3, 0.1, 0, 0, 0};
  const auto dataset = OpenDataset(FolderOfThree(), options);
  cv::Mat grey;
  const ColourImage read = dataset->ReadColour(1);
  cv::cvtColor(read.image, grey, cv::COLOR_BGR2GRAY);
  EXPECT_LE(Difference(grey, dataset->Read(1).frame->image), 2.0);
  EXPECT_GT(Difference(read.image, Colourful(1)), 5.0);
}

TEST(ReadColour, OfPartsOfADataSetIsThatOfTheirFramesWithoutNoise) {
  DatasetOptions options = ColourOptions();
  options.start = 1;
  options.noise = 20;
  const auto dataset = OpenDataset(FolderOfThree(), options);
  EXPECT_EQ(Difference(dataset->ReadColour(1).image, Colourful(2)), 0.0);
}

TEST(ReadColour, OfGreyImagesIsGrey) {
  const fs::path folder = testing::FreshFolder();
  testing::WriteImage(folder / "0.png", testing::Picture(64, 48, 3));
  const ColourImage read = OpenDataset(folder, ColourOptions())->ReadColour(0);
  cv::Mat expected;
  cv::cvtColor(testing::Picture(64, 48, 3), expected, cv::COLOR_GRAY2BGR);
  EXPECT_EQ(Difference(read.image, expected), 0.0);
}

TEST(ReadColour, WhatIsWrongIsSaid) {
  const fs::path folder = FolderOfThree();
  const auto dataset = OpenDataset(folder, ColourOptions());
  testing::Truncate(folder / "1.png", 0.5);
  testing::WriteImage(folder / "2.png", cv::Mat(20, 20, CV_8UC3, cv::Scalar(1, 2, 3)));
  EXPECT_THAT(dataset->ReadColour(1).error, HasSubstr("1.png: is truncated"));
  EXPECT_THAT(dataset->ReadColour(2).error, HasSubstr("20x20"));
  EXPECT_THAT(dataset->ReadColour(3).error, HasSubstr("has no frame 3"));
  EXPECT_TRUE(dataset->ReadColour(1).image.empty());
}

// Motion JPEG keeps colours to a few levels.
TEST(ReadColour, OfAVideoInAnyOrder) {
  const fs::path file = testing::FreshFolder() / "film.avi";
  std::vector<cv::Mat> images;
  for (int i = 0; i < 6; ++i) images.push_back(Colourful(i));
  ASSERT_TRUE(testing::WriteMotionJpeg(file, images));
  const auto dataset = OpenDataset(file, ColourOptions());
  for (const int i : {4, 1, 5, 0}) {
    const ColourImage read = dataset->ReadColour(static_cast<std::size_t>(i));
    ASSERT_EQ(read.error, "") << i;
    EXPECT_LT(cv::norm(read.image, Colourful(i), cv::NORM_L1) / (64 * 48 * 3), 4.0) << i;
    cv::Mat grey;
    cv::cvtColor(read.image, grey, cv::COLOR_BGR2GRAY);
    EXPECT_EQ(Difference(grey, dataset->Read(static_cast<std::size_t>(i)).frame->image), 0.0) << i;
  }
  EXPECT_THAT(dataset->ReadColour(6).error, HasSubstr("frame 6 can't be decoded"));
}

}  // namespace
}  // namespace tutti
