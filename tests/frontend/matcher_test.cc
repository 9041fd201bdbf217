// Data association on a made-up scene: random points with random descriptors, seen without noise.
#include "matcher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace tutti {
namespace {

PinholeCamera Camera() {
  PinholeCamera c;
  c.width = 640;
  c.height = 480;
  c.fx = c.fy = 450;
  c.cx = 319.5;
  c.cy = 239.5;
  return c;
}

class MatcherTest : public ::testing::Test {
 protected:
  static constexpr int kPoints = 300;

  MatcherTest() : map_(PyramidScales(OdometryOptions())) {
    cv::RNG rng(11);
    descriptors_.create(kPoints, 32, CV_8UC1);
    rng.fill(descriptors_, cv::RNG::UNIFORM, 0, 256);
    for (int i = 0; i < kPoints; ++i) {
      const double z = rng.uniform(4.0, 12.0);
      points_.emplace_back(z * rng.uniform(-0.55, 0.55), z * rng.uniform(-0.4, 0.4), z);
    }
  }

  // What a camera sees: feature i is point order[i]; points outside the image are left out.
  std::shared_ptr<Features> See(const Pose& T_world_camera, std::vector<int>* order) const {
    auto features = std::make_shared<Features>();
    const Pose T_camera_world = T_world_camera.Inverse();
    order->clear();
    for (int i = kPoints - 1; i >= 0; --i) {
      const Eigen::Vector3d p = T_camera_world * points_[static_cast<std::size_t>(i)];
      if (p.z() <= 0.1 || !camera_.Contains(camera_.Project(p), 2)) continue;
      const Eigen::Vector2d pixel = camera_.Project(p);
      features->keypoints.emplace_back(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()), 31.0F,
                                       static_cast<float>(i % 40), 1.0F, 1);
      features->descriptors.push_back(descriptors_.row(i));
      order->push_back(i);
    }
    features->inverse_depth.assign(features->size(), 0.0F);
    features->inverse_depth_sigma.assign(features->size(), 0.0F);
    features->BuildGrid(camera_.width, camera_.height);
    return features;
  }

  int AddKeyframe(const Pose& T_world_camera, std::vector<int>* order) {
    Keyframe k;
    k.T_world_camera = T_world_camera;
    k.features = See(T_world_camera, order);
    return map_.AddKeyframe(k);
  }

  // A keyframe at the origin whose features all have a landmark: landmark l is point order_[l].
  void MakeLandmarks() {
    const int id = AddKeyframe(Pose(), &order_);
    for (std::size_t f = 0; f < order_.size(); ++f) {
      map_.AddLandmark(points_[static_cast<std::size_t>(order_[f])], id, static_cast<int>(f));
      map_.UpdateLandmark(static_cast<int>(f));
    }
  }

  // Number of features with a landmark; every one of them must be right.
  int CountRight(const FrameMatches& matches, const std::vector<int>& order) const {
    int count = 0;
    for (std::size_t f = 0; f < matches.landmarks.size(); ++f) {
      if (matches.landmarks[f] < 0) continue;
      EXPECT_EQ(order_[static_cast<std::size_t>(matches.landmarks[f])], order[f]);
      ++count;
    }
    return count;
  }

  static FrameMatches Unmatched(const Features& features) {
    return {&features, std::vector<int>(features.size(), -1)};
  }

  PinholeCamera camera_ = Camera();
  Map map_;
  cv::Mat descriptors_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<int> order_;
  const Pose moved_{ExpSO3({0.01, -0.02, 0.01}), {0.2, 0.05, 0.3}};
};

TEST_F(MatcherTest, LastFramesLandmarksAreFoundAroundThePrediction) {
  MakeLandmarks();
  std::vector<int> order;
  const auto features = See(moved_, &order);
  FrameMatches last{map_.keyframe(0).features.get(), map_.keyframe(0).landmarks}, now = Unmatched(*features);
  // The prediction is off by a few pixels.
  const Pose prediction = (moved_ * Pose(ExpSO3({0, 0.01, 0}), {0, 0, 0.02})).Inverse();
  const int count = MatchToLastFrame(map_, camera_, prediction, last, 15.0F, &now);
  EXPECT_EQ(count, CountRight(now, order));
  EXPECT_GT(count, 0.95 * static_cast<double>(features->size()));
}

TEST_F(MatcherTest, MatchesThatTurnUnlikeTheMajorityAreDropped) {
  MakeLandmarks();
  std::vector<int> order;
  const auto features = See(Pose(), &order);
  for (std::size_t f = 0; f < 20; ++f) features->keypoints[f].angle += 90.0F + 13.0F * static_cast<float>(f);
  FrameMatches last{map_.keyframe(0).features.get(), map_.keyframe(0).landmarks}, now = Unmatched(*features);
  const int count = MatchToLastFrame(map_, camera_, Pose(), last, 15.0F, &now);
  EXPECT_EQ(count, static_cast<int>(features->size()) - 20);
  for (std::size_t f = 0; f < 20; ++f) EXPECT_EQ(now.landmarks[f], -1);
}

TEST_F(MatcherTest, NothingIsFoundBehindTheCameraOrOutsideTheImage) {
  MakeLandmarks();
  std::vector<int> order, visible, all(order_.size());
  std::iota(all.begin(), all.end(), 0);
  const auto features = See(Pose(), &order);
  FrameMatches last{map_.keyframe(0).features.get(), map_.keyframe(0).landmarks};
  for (const Pose& T_world_camera :
       {Pose(ExpSO3({0, M_PI, 0}), {0, 0, 0}), Pose(ExpSO3({0, M_PI / 2, 0}), {0, 0, 0}),
        Pose(Eigen::Quaterniond::Identity(), {0, 0, 100})}) {
    FrameMatches now = Unmatched(*features);
    EXPECT_EQ(MatchToLastFrame(map_, camera_, T_world_camera.Inverse(), last, 60.0F, &now), 0);
    EXPECT_EQ(MatchToLandmarks(map_, camera_, T_world_camera.Inverse(), all, 3.0F, &now, &visible), 0);
  }
  EXPECT_TRUE(visible.empty());
}

TEST_F(MatcherTest, LocalMapIsFoundAndCountedAsVisible) {
  MakeLandmarks();
  std::vector<int> order, visible, all(order_.size());
  std::iota(all.begin(), all.end(), 0);
  const auto features = See(moved_, &order);
  FrameMatches now = Unmatched(*features);
  const int count = MatchToLandmarks(map_, camera_, moved_.Inverse(), all, 1.0F, &now, &visible);
  EXPECT_EQ(count, CountRight(now, order));
  EXPECT_GT(count, 0.95 * static_cast<double>(features->size()));
  EXPECT_GE(visible.size(), static_cast<std::size_t>(count));
}

TEST_F(MatcherTest, DeadLandmarksAreNotFound) {
  MakeLandmarks();
  std::vector<int> order, visible, all(order_.size());
  std::iota(all.begin(), all.end(), 0);
  const auto features = See(Pose(), &order);
  FrameMatches last{map_.keyframe(0).features.get(), map_.keyframe(0).landmarks}, now = Unmatched(*features);
  for (const int l : all) map_.RemoveLandmark(l);
  EXPECT_EQ(MatchToLastFrame(map_, camera_, Pose(), last, 15.0F, &now), 0);
  EXPECT_EQ(MatchToLandmarks(map_, camera_, Pose(), all, 1.0F, &now, &visible), 0);
  EXPECT_EQ(MatchToKeyframe(map_, map_.keyframe(0), &now), 0);
}

TEST_F(MatcherTest, KeyframeIsRecognisedFromAnywhereItsPointsAreSeen) {
  MakeLandmarks();
  std::vector<int> order;
  const auto features = See(Pose(ExpSO3({0.1, 0.1, 0.0}), {0.5, 0.5, 1.0}), &order);
  FrameMatches now = Unmatched(*features);
  const int count = MatchToKeyframe(map_, map_.keyframe(0), &now);
  EXPECT_EQ(count, CountRight(now, order));
  EXPECT_GT(count, 0.8 * static_cast<double>(features->size()));
}

TEST_F(MatcherTest, TwinsWithTheSameDescriptorAreAmbiguousWithoutAPrediction) {
  MakeLandmarks();
  std::vector<int> order;
  const auto features = See(Pose(), &order);
  features->descriptors.row(0).copyTo(features->descriptors.row(1));
  FrameMatches now = Unmatched(*features);
  MatchToKeyframe(map_, map_.keyframe(0), &now);
  EXPECT_EQ(now.landmarks[0], -1);
  EXPECT_EQ(now.landmarks[1], -1);
  EXPECT_GE(now.landmarks[2], 0);
}

TEST_F(MatcherTest, TwoViewsMatchNearTheOldPlaceAndCentresFollow) {
  std::vector<int> first_order, second_order;
  const auto first = See(Pose(), &first_order), second = See(moved_, &second_order);
  std::vector<cv::Point2f> centres;
  for (const cv::KeyPoint& k : first->keypoints) centres.push_back(k.pt);
  const auto pairs = MatchTwoViews(*first, *second, 100.0F, &centres);
  EXPECT_GT(pairs.size(), 200U);
  for (const auto& [a, b] : pairs) {
    EXPECT_EQ(first_order[static_cast<std::size_t>(a)], second_order[static_cast<std::size_t>(b)]);
    EXPECT_EQ(centres[static_cast<std::size_t>(a)], second->keypoints[static_cast<std::size_t>(b)].pt);
  }
}

TEST_F(MatcherTest, EpipolarSearchFindsPairsWithoutLandmarks) {
  std::vector<int> first_order, second_order;
  const Pose sideways(ExpSO3({0, -0.02, 0}), {0.6, 0.1, 0.1});
  const int a = AddKeyframe(Pose(), &first_order), b = AddKeyframe(sideways, &second_order);
  map_.AddLandmark(points_[static_cast<std::size_t>(first_order[5])], a, 5);
  const auto pairs = MatchEpipolar(map_, camera_, map_.keyframe(a), map_.keyframe(b), 8.0);
  EXPECT_GT(pairs.size(), 200U);
  for (const auto& [f, g] : pairs) {
    EXPECT_EQ(first_order[static_cast<std::size_t>(f)], second_order[static_cast<std::size_t>(g)]);
    EXPECT_NE(f, 5);
  }
}

TEST_F(MatcherTest, WrongGeometryHasNoEpipolarPairs) {
  std::vector<int> first_order, second_order;
  const int a = AddKeyframe(Pose(), &first_order);
  const int b = AddKeyframe(Pose(Eigen::Quaterniond::Identity(), {0.6, 0, 0}), &second_order);
  // The map believes that the second camera looks 20 px lower than it does.
  map_.keyframe(b).T_world_camera.rotation = ExpSO3({-20.0 / 450, 0, 0});
  EXPECT_LT(MatchEpipolar(map_, camera_, map_.keyframe(a), map_.keyframe(b), 8.0).size(), 10U);
}

TEST_F(MatcherTest, FusionFindsLandmarksWhereTheyHaveNoFeatureYet) {
  MakeLandmarks();
  std::vector<int> order, all(order_.size());
  std::iota(all.begin(), all.end(), 0);
  const int id = AddKeyframe(moved_, &order);
  const auto pairs = MatchForFusion(map_, camera_, map_.keyframe(id), all, 3.0F);
  EXPECT_GT(pairs.size(), 0.95 * static_cast<double>(order.size()));
  for (const auto& [landmark, feature] : pairs)
    EXPECT_EQ(order_[static_cast<std::size_t>(landmark)], order[static_cast<std::size_t>(feature)]);
  // In their own keyframe they are known already.
  EXPECT_TRUE(MatchForFusion(map_, camera_, map_.keyframe(0), all, 3.0F).empty());
}

TEST_F(MatcherTest, EmptyFramesAndMapsMatchNothing) {
  const auto empty = std::make_shared<Features>();
  empty->BuildGrid(camera_.width, camera_.height);
  FrameMatches none{empty.get(), {}};
  std::vector<int> visible, order;
  std::vector<cv::Point2f> centres;
  EXPECT_EQ(MatchToLastFrame(map_, camera_, Pose(), none, 15.0F, &none), 0);
  EXPECT_EQ(MatchToLandmarks(map_, camera_, Pose(), {}, 1.0F, &none, &visible), 0);
  EXPECT_TRUE(MatchTwoViews(*empty, *empty, 100.0F, &centres).empty());
  Keyframe k;
  k.features = empty;
  const int a = map_.AddKeyframe(k), b = AddKeyframe(moved_, &order);
  EXPECT_EQ(MatchToKeyframe(map_, map_.keyframe(a), &none), 0);
  EXPECT_TRUE(MatchEpipolar(map_, camera_, map_.keyframe(a), map_.keyframe(b), 8.0).empty());
  EXPECT_TRUE(MatchEpipolar(map_, camera_, map_.keyframe(b), map_.keyframe(a), 8.0).empty());
  EXPECT_TRUE(MatchForFusion(map_, camera_, map_.keyframe(a), {}, 3.0F).empty());
}

}  // namespace
}  // namespace tutti
