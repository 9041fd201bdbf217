// Images of keyframes: in colour, where the map says, without what is left of the lens.
#include "apps/export/keyframe_images.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "frontend/dataset/rectified_rig.h"
#include "frontend/geometry/lens_error.h"
#include "tests/apps/export/mapped_room.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

PinholeCamera Camera() { return Pinhole(60, 60, 47.5, 31.5, {96, 64}); }

// Three images: red left of the middle and blue right of it; a fine grid; the same grid, blurred.
std::unique_ptr<Dataset> ThreeImages(const fs::path& folder) {
  cv::Mat halves(64, 96, CV_8UC3, cv::Scalar(200, 0, 0));
  halves.colRange(0, 48).setTo(cv::Scalar(0, 40, 240));
  cv::Mat grid(64, 96, CV_8UC3), blurred;
  for (int v = 0; v < 64; ++v) {
    for (int u = 0; u < 96; ++u)
      grid.at<cv::Vec3b>(v, u) = cv::Vec3b::all((u / 4 + v / 4) % 2 == 0 ? 220 : 30);
  }
  cv::GaussianBlur(grid, blurred, {0, 0}, 1.5);
  cv::imwrite((folder / "0.png").string(), halves);
  cv::imwrite((folder / "1.png").string(), grid);
  cv::imwrite((folder / "2.png").string(), blurred);
  DatasetOptions options;
  options.camera = Camera();
  options.rate_hz = 10;
  return OpenDataset(folder, options);
}

MapModel ModelOfThree() {
  MapModel model;
  model.camera = Camera();
  for (int i = 0; i < 3; ++i) model.keyframes.push_back({i, i, 0.1 * i, Pose(), {}});
  model.keyframes[0].views = {{5, {10, 10}}, {6, {80, 10}}, {7, {80, 30}}};
  model.keyframes[1].views = {{6, {0, 0}}};
  for (const int id : {5, 6, 7, 8}) model.landmarks.push_back({id, {0, 0, 1}, id == 6 ? 2 : 1});
  return model;
}

using Rgb = std::array<std::uint8_t, 3>;

TEST(KeyframeImages, LandmarksGetTheMeanColourOfTheirViews) {
  const auto dataset = ThreeImages(testing::FreshFolder());
  MapModel model = ModelOfThree();
  const KeyframeImages images(*dataset, model);
  const Looks looks = LookAtImages(images, &model);
  EXPECT_TRUE(looks.errors.empty());
  EXPECT_EQ(model.landmarks[0].rgb, (Rgb{{240, 40, 0}}));
  EXPECT_EQ(model.landmarks[1].rgb, (Rgb{{110, 110, 210}})) << "blue, and the grid's white";
  EXPECT_EQ(model.landmarks[2].rgb, (Rgb{{0, 0, 200}}));
  EXPECT_EQ(model.landmarks[3].rgb, (Rgb{{128, 128, 128}})) << "nobody sees it";
}

TEST(KeyframeImages, ABlurredImageIsLessSharp) {
  const auto dataset = ThreeImages(testing::FreshFolder());
  MapModel model = ModelOfThree();
  const Looks looks = LookAtImages(KeyframeImages(*dataset, model), &model);
  EXPECT_GT(*looks.sharpness[1], 4 * *looks.sharpness[2]);
}

TEST(KeyframeImages, AnImageThatIsGoneIsToldAndTheOthersStay) {
  const fs::path folder = testing::FreshFolder();
  const auto dataset = ThreeImages(folder);
  fs::remove(folder / "1.png");
  MapModel model = ModelOfThree();
  const Looks looks = LookAtImages(KeyframeImages(*dataset, model), &model);
  ASSERT_EQ(looks.errors.size(), 1u);
  EXPECT_THAT(looks.errors[0], HasSubstr("1.png: is missing"));
  EXPECT_TRUE(looks.sharpness[0] && !looks.sharpness[1] && looks.sharpness[2]);
}

// A pixel of a view is in the image where the feature was found, moved by the correction of the lens.
TEST(KeyframeImages, WhatSelfCalibrationFoundOfTheLensIsTakenOut) {
  const fs::path folder = testing::FreshFolder();
  MapModel model = ModelOfThree();
  model.lens = {0.2, 0.05};
  const Eigen::Vector2d found(80, 50);
  cv::Mat dot(64, 96, CV_8UC3, cv::Scalar(0, 0, 0));
  dot.at<cv::Vec3b>(50, 80) = cv::Vec3b::all(255);
  cv::GaussianBlur(dot, dot, {0, 0}, 1.2);
  const auto dataset = ThreeImages(folder);
  cv::imwrite((folder / "0.png").string(), dot);
  const cv::Mat image = KeyframeImages(*dataset, model).Read(model.keyframes[0]).image;
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  const cv::Moments moments = cv::moments(grey);
  const Eigen::Vector2d expected = LensError::Correct(model.camera, model.lens, found);
  EXPECT_GT((expected - found).norm(), 2.0);
  EXPECT_NEAR(moments.m10 / moments.m00, expected.x(), 0.2);
  EXPECT_NEAR(moments.m01 / moments.m00, expected.y(), 0.2);
}

TEST(KeyframeImages, OfAnotherDataSetAreRefused) {
  const auto dataset = ThreeImages(testing::FreshFolder());
  MapModel camera = ModelOfThree(), stamps = ModelOfThree();
  camera.camera.fx += 1;
  for (ModelKeyframe& keyframe : stamps.keyframes) keyframe.stamp_s += 0.05;
  EXPECT_THAT(testing::ErrorOf([&] { KeyframeImages(*dataset, camera); }), HasSubstr("another camera"));
  EXPECT_THAT(testing::ErrorOf([&] { KeyframeImages(*dataset, stamps); }), HasSubstr("no frame of the map"));
}

TEST(KeyframeImages, AreThoseThatTheMapWasMadeOf) {
  const testing::MappedRoom& room = testing::Room();
  const MapModel model = room.Model();
  const KeyframeImages images(*room.dataset, model);
  for (const std::size_t k : {std::size_t{0}, model.keyframes.size() - 1}) {
    const ModelKeyframe& keyframe = model.keyframes[k];
    const ReadResult read = room.dataset->Read(static_cast<std::size_t>(keyframe.frame_index));
    const ColourImage colour = images.Read(keyframe);
    ASSERT_TRUE(read.frame);
    ASSERT_EQ(colour.image.type(), CV_8UC3);
    cv::Mat grey;
    cv::extractChannel(colour.image, grey, 1);
    EXPECT_EQ(cv::norm(grey, read.frame->image, cv::NORM_INF), 0.0);
  }
}

}  // namespace
}  // namespace tutti
