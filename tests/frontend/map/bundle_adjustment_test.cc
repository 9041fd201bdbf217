#include "frontend/map/bundle_adjustment.h"
#include "frontend/features/features.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/plain_camera.h"

namespace tutti {
namespace {

constexpr int kKeyframes = 5, kPoints = 60;

PinholeCamera BundleCamera() { return testing::PlainCamera(500); }

// A camera that moves to the right past a cloud of points; every keyframe sees all of them.
struct World {
  Map map{{1.0F}};
  std::vector<Pose> truth;
  std::vector<Eigen::Vector3d> points;

  explicit World(bool with_depth) {
    std::mt19937 generator(11);
    const auto uniform = [&](double low, double high) {
      return low + (high - low) * static_cast<double>(generator() % 100000) / 1e5;
    };
    for (int i = 0; i < kPoints; ++i) {
      const double z = uniform(6, 12), y = uniform(-2, 2), x = uniform(-2, 4);
      points.emplace_back(x, y, z);
    }
    for (int k = 0; k < kKeyframes; ++k) {
      const Pose T_world_camera(ExpSO3({0, 0.02 * k, 0.01 * k}), {0.5 * k, 0.05 * k, 0.1 * k});
      truth.push_back(T_world_camera);
      auto features = std::make_shared<FrameFeatures>();
      features->descriptors = cv::Mat::zeros(kPoints, 32, CV_8U);
      for (const Eigen::Vector3d& point : points) {
        const Eigen::Vector3d p = T_world_camera.Inverse() * point;
        const Eigen::Vector2d pixel = BundleCamera().Project(p);
        features->keypoints.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 31.0F);
        features->keypoints.back().octave = 0;
        features->inverse_depth.push_back(with_depth ? static_cast<float>(1 / p.z()) : 0.0F);
        features->inverse_depth_sigma.push_back(with_depth ? 0.002F : 0.0F);
      }
      Keyframe keyframe;
      keyframe.features = features;
      keyframe.T_world_camera = T_world_camera;
      map.AddKeyframe(keyframe);
    }
    for (int i = 0; i < kPoints; ++i) {
      const int l = map.AddLandmark(points[static_cast<std::size_t>(i)], 0, i);
      for (int k = 1; k < kKeyframes; ++k) map.AddObservation(l, k, i);
    }
  }

  void Disturb(const std::vector<int>& keyframes) {
    for (int k : keyframes) {
      Pose& T = map.keyframe(k).T_world_camera;
      T = T * Pose(ExpSO3({0.004, -0.006, 0.003}), {0.04, -0.03, 0.05});
    }
    for (int i = 0; i < kPoints; ++i) map.landmark(i).position += Eigen::Vector3d(0.03, -0.02, 0.1);
  }

  double WorstError() const {
    double worst = 0;
    for (int k = 0; k < kKeyframes; ++k) {
      worst = std::max(
          worst,
          LogSE3(truth[static_cast<std::size_t>(k)].Inverse() * map.keyframe(k).T_world_camera).norm());
    }
    return worst;
  }
};

BundleAdjustmentOptions BundleOptions(bool metric) {
  BundleAdjustmentOptions options;
  options.iterations = 30;
  options.metric = metric;
  return options;
}

TEST(BundleAdjustment, BringsPosesAndPointsBack) {
  for (const bool with_depth : {false, true}) {
    World world(with_depth);
    world.Disturb({2, 3, 4});
    const BundleAdjustmentReport report =
        AdjustWindow(BundleCamera(), {2, 3, 4}, {0, 1}, BundleOptions(with_depth), &world.map);
    EXPECT_TRUE(report.usable);
    EXPECT_EQ(report.removed, 0);
    EXPECT_EQ(report.observations, kKeyframes * kPoints);
    EXPECT_LT(report.final_cost, 1e-3 * report.initial_cost);
    EXPECT_LT(world.WorstError(), 1e-3) << with_depth;
  }
}

TEST(BundleAdjustment, DepthFixesTheScaleWithOneFixedKeyframe) {
  World world(true);
  world.Disturb({1, 2, 3, 4});
  EXPECT_TRUE(AdjustWindow(BundleCamera(), {1, 2, 3, 4}, {0}, BundleOptions(true), &world.map).usable);
  EXPECT_LT(world.WorstError(), 2e-3);
}

TEST(BundleAdjustment, FixedKeyframesStayWhereTheyAre) {
  World world(false);
  world.Disturb({2, 3, 4});
  AdjustWindow(BundleCamera(), {2, 3, 4}, {0, 1}, BundleOptions(false), &world.map);
  for (int k : {0, 1}) {
    EXPECT_EQ(world.map.keyframe(k).T_world_camera.Matrix(),
              world.truth[static_cast<std::size_t>(k)].Matrix());
  }
}

TEST(BundleAdjustment, WrongMatchesAreRemoved) {
  World world(false);
  auto features = std::make_shared<FrameFeatures>(*world.map.keyframe(4).features);
  for (int i = 0; i < 5; ++i) features->keypoints[static_cast<std::size_t>(i)].pt += cv::Point2f(40, -30);
  world.map.keyframe(4).features = features;
  world.Disturb({2, 3, 4});
  const BundleAdjustmentReport report =
      AdjustWindow(BundleCamera(), {2, 3, 4}, {0, 1}, BundleOptions(false), &world.map);
  EXPECT_EQ(report.removed, 5);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(world.map.keyframe(4).landmarks[static_cast<std::size_t>(i)], -1);
  // The Huber loss has bounded their pull; the next adjustment is free of it.
  EXPECT_LT(world.WorstError(), 0.02);
  EXPECT_EQ(AdjustWindow(BundleCamera(), {2, 3, 4}, {0, 1}, BundleOptions(false), &world.map).removed, 0);
  EXPECT_LT(world.WorstError(), 1e-3);
}

TEST(BundleAdjustment, LocalWindowFixesItsOldestKeyframesWhereNothingElseDoes) {
  for (const bool metric : {false, true}) {
    World world(metric);
    const BundleAdjustmentReport report = AdjustLocally(BundleCamera(), 4, BundleOptions(metric), &world.map);
    EXPECT_TRUE(report.usable);
    EXPECT_EQ(report.fixed, metric ? 1 : 2);
    EXPECT_EQ(report.keyframes + report.fixed, kKeyframes);
  }
}

TEST(BundleAdjustment, WhatIsKeptStaysAsItIsAndHoldsWhatIsNew) {
  World world(true);
  const int kept = kPoints / 2;
  auto features = std::make_shared<FrameFeatures>(*world.map.keyframe(2).features);
  features->keypoints[0].pt += cv::Point2f(40, -30);  // a view that does not fit
  world.map.keyframe(2).features = features;
  world.Disturb({3, 4});
  for (int i = 0; i < kept; ++i) world.map.landmark(i).position = world.points[static_cast<std::size_t>(i)];
  BundleAdjustmentOptions options = BundleOptions(true);
  options.kept_keyframes = 3;
  options.kept_landmarks = kept;
  const BundleAdjustmentReport report = AdjustLocally(BundleCamera(), 4, options, &world.map);
  EXPECT_TRUE(report.usable);
  EXPECT_EQ(report.keyframes, 2);
  EXPECT_LT(world.WorstError(), 2e-3);
  for (int k = 0; k < options.kept_keyframes; ++k) {
    EXPECT_EQ(world.map.keyframe(k).T_world_camera.Matrix(),
              world.truth[static_cast<std::size_t>(k)].Matrix());
  }
  for (int i = 0; i < kept; ++i)
    EXPECT_EQ(world.map.landmark(i).position, world.points[static_cast<std::size_t>(i)]);
  EXPECT_EQ(world.map.keyframe(2).landmarks[0], 0) << "what a kept keyframe sees, it keeps";
}

TEST(BundleAdjustment, NothingToAdjustIsNoCrash) {
  World world(false);
  EXPECT_FALSE(AdjustWindow(BundleCamera(), {}, {0, 1}, BundleOptions(false), &world.map).usable);
  Map empty({1.0F});
  Keyframe lonely;
  lonely.features = std::make_shared<FrameFeatures>();
  empty.AddKeyframe(lonely);
  EXPECT_FALSE(AdjustLocally(BundleCamera(), 0, BundleOptions(true), &empty).usable);
}

TEST(BundleAdjustment, SameInputGivesTheSameBits) {
  const auto run = [] {
    World world(true);
    world.Disturb({1, 2, 3, 4});
    AdjustWindow(BundleCamera(), {1, 2, 3, 4}, {0}, BundleOptions(true), &world.map);
    return world.map.keyframe(4).T_world_camera.Matrix();
  };
  EXPECT_EQ(run(), run());
}

}  // namespace
}  // namespace tutti
