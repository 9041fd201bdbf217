// Views that are dropped, and views that are found in the images.
#include "apps/export/colmap_model.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "frontend/dataset/rectified_rig.h"
#include "tests/apps/export/mapped_room.h"
#include "tests/support/test_data.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

constexpr double kFocal = 200, kDepth = 2, kStep = 0.0525;  // a step is 5.25 pixels

// A textured wall, two metres away, from three places on a line along x.
class Wall : public ::testing::Test {
 protected:
  Wall() {
    const fs::path folder = testing::FreshFolder();
    cv::Mat texture(160, 260, CV_8UC1), shifted;
    cv::RNG random(7);
    random.fill(texture, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(texture, texture, {0, 0}, 2.0);
    cv::normalize(texture, texture, 0, 255, cv::NORM_MINMAX);
    for (int k = 0; k < 3; ++k) {
      const double shift = k * kStep * kFocal / kDepth;
      const cv::Mat move = (cv::Mat_<double>(2, 3) << 1, 0, -20 - shift, 0, 1, -20);
      cv::warpAffine(texture, shifted, move, {200, 120}, cv::INTER_CUBIC);
      cv::imwrite((folder / (std::to_string(k) + ".png")).string(), shifted);
    }
    DatasetOptions options;
    options.camera = Pinhole(kFocal, kFocal, 100, 60, {200, 120});
    options.rate_hz = 10;
    dataset_ = OpenDataset(folder, options);
    model_.camera = *options.camera;
    for (int k = 0; k < 3; ++k)
      model_.keyframes.push_back(
          {k, k, 0.1 * k, Pose(Eigen::Quaterniond::Identity(), Eigen::Vector3d(k * kStep, 0, 0)), {}});
    for (int i = 0; i < 20; ++i) {
      const cv::Point2f pixel(50.0F + 5 * static_cast<float>(i), 30.0F + 3 * static_cast<float>(i));
      model_.keyframes[0].views.push_back({i, pixel});
      model_.landmarks.push_back({i, kDepth * model_.camera.Unproject({pixel.x, pixel.y}), 1, {}});
    }
  }

  TrackChanges Refine(const std::vector<std::size_t>& chosen) {
    return RefineTracks(KeyframeImages(*dataset_, model_), chosen, &model_);
  }

  std::unique_ptr<Dataset> dataset_;
  MapModel model_;
};

TEST_F(Wall, LandmarksAreFoundWhereTheImageHasThem) {
  model_.landmarks[4].position.x() += 0.002;  // the map is off by a fifth of a pixel; the image decides
  const TrackChanges changes = Refine({0, 1, 2});
  EXPECT_EQ(changes.dropped, 0u);
  EXPECT_GE(changes.added, 36u);
  for (std::size_t k = 1; k < 3; ++k) {
    for (const SeenLandmark& view : model_.keyframes[k].views) {
      const cv::Point2f first = model_.keyframes[0].views[static_cast<std::size_t>(view.landmark)].pixel;
      EXPECT_NEAR(view.pixel.x, first.x - 5.25 * static_cast<double>(k), 0.08) << view.landmark;
      EXPECT_NEAR(view.pixel.y, first.y, 0.05) << view.landmark;
    }
  }
  EXPECT_EQ(model_.landmarks[0].observations, 1) << "that is the map's";
}

TEST_F(Wall, OnlyChosenKeyframesAreLookedAt) {
  Refine({0, 2});
  EXPECT_TRUE(model_.keyframes[1].views.empty());
  EXPECT_FALSE(model_.keyframes[2].views.empty());
}

TEST_F(Wall, WhatIsNotWhereTheMapSaysIsNotFound) {
  for (ModelLandmark& landmark : model_.landmarks) landmark.position *= 1.25;  // the projection is 1 px off
  EXPECT_EQ(Refine({0, 1}).added, 0u);
}

TEST_F(Wall, ViewsFarFromTheProjectionAreDropped) {
  model_.keyframes[0].views[3].pixel.x += 4;
  const TrackChanges changes = Refine({0});
  EXPECT_EQ(changes.most_px, 0.5);
  EXPECT_EQ(changes.dropped, 1u);
  EXPECT_EQ(model_.keyframes[0].views.size(), 19u);
}

TEST_F(Wall, InANoisyMapFartherOnesStay) {
  for (std::size_t i = 0; i < 20; ++i) model_.keyframes[0].views[i].pixel.y += i % 2 == 0 ? 1.0F : -1.0F;
  model_.keyframes[0].views[3].pixel.x += 4;
  const TrackChanges changes = Refine({0});
  EXPECT_NEAR(changes.most_px, 3, 0.01);
  EXPECT_EQ(changes.dropped, 1u);
}

TEST(RefineTracks, OfARealMapMakesThemLonger) {
  MapModel model = testing::Room().Model();
  std::vector<std::size_t> all;
  std::size_t before = 0, after = 0;
  for (std::size_t k = 0; k < model.keyframes.size(); ++k) {
    all.push_back(k);
    before += model.keyframes[k].views.size();
  }
  const TrackChanges changes = RefineTracks(KeyframeImages(*testing::Room().dataset, model), all, &model);
  for (const ModelKeyframe& keyframe : model.keyframes) {
    std::set<int> landmarks;
    for (const SeenLandmark& view : keyframe.views) landmarks.insert(view.landmark);
    EXPECT_EQ(landmarks.size(), keyframe.views.size()) << "one view each";
    after += keyframe.views.size();
  }
  EXPECT_EQ(after, before - changes.dropped + changes.added);
  EXPECT_GT(changes.added, 500u);
}

}  // namespace
}  // namespace tutti
