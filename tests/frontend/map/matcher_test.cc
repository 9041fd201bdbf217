// Data association on a made-up scene: random points with random descriptors, seen without noise.
#include "frontend/map/matcher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "tests/frontend/map/point_scene.h"

namespace tutti {
namespace {

class MatcherTest : public ::testing::Test, protected testing::PointScene {
 protected:
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

  static FrameMatches Unmatched(const FrameFeatures& features) {
    return {&features, std::vector<int>(features.size(), -1)};
  }

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
  const auto empty = std::make_shared<FrameFeatures>();
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
