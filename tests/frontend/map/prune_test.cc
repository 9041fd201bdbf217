#include "frontend/map/prune.h"

#include <gtest/gtest.h>

#include <utility>
#include "frontend/features/features.h"

namespace tutti {
namespace {

constexpr int kFeaturesEach = 40;

// Features of octave 1 (of 3), each with a descriptor of its own.
Keyframe KeyframeAt(double x) {
  auto features = std::make_shared<FrameFeatures>();
  features->keypoints.assign(kFeaturesEach, cv::KeyPoint(10.0F, 10.0F, 31.0F));
  for (cv::KeyPoint& keypoint : features->keypoints) keypoint.octave = 1;
  features->descriptors = cv::Mat(kFeaturesEach, 32, CV_8U, cv::Scalar(0));
  features->inverse_depth.assign(kFeaturesEach, 0.0F);
  features->inverse_depth_sigma.assign(kFeaturesEach, 0.0F);
  Keyframe keyframe;
  keyframe.features = features;
  keyframe.T_world_camera.translation.x() = x;
  return keyframe;
}

// Keyframes at nearly one place that all see the same landmarks, by feature.
class RedundantKeyframes : public ::testing::Test {
 protected:
  void SetUp() override {
    for (int id = 0; id < 6; ++id) map_.AddKeyframe(KeyframeAt(0.01 * id));
    for (int f = 0; f < kFeaturesEach; ++f) {
      const int landmark = map_.AddLandmark({0, 0, 5}, 0, f);
      for (int id = 1; id < 6; ++id) map_.AddObservation(landmark, id, f);
    }
  }
  // A feature of a keyframe no longer sees its landmark, but one of its own.
  void SeesSomethingElse(int keyframe, int feature) {
    map_.RemoveObservation(feature, keyframe);
    map_.AddLandmark({0, 0, 7}, keyframe, feature);
  }
  std::map<int, int> Remove(const std::set<int>& keep = {}) { return Prune(keep, 1, may_, &map_); }
  bool IsThere(int keyframe) const { return map_.keyframe(keyframe).replaced_by < 0; }

  Map map_{{1.0F, 1.2F, 1.44F, 1.728F}};
  std::function<bool(int, int)> may_ = [](int, int) { return true; };
};

TEST_F(RedundantKeyframes, AreRemovedUntilThreeSeeEachLandmarkAndTheOldestStandsForThem) {
  EXPECT_EQ(Remove(), (std::map<int, int>{{5, 0}, {4, 0}, {3, 0}}))
      << "with two others left none of the three is redundant";
  EXPECT_TRUE(Remove().empty());
  for (int f = 0; f < kFeaturesEach; ++f) EXPECT_EQ(map_.landmark(f).observations.size(), 3U);
}

TEST_F(RedundantKeyframes, WithSomethingOfItsOwnAKeyframeStays) {
  for (int f = 0; f < 6; ++f) SeesSomethingElse(5, f);  // 85 % remain
  for (int f = 6; f < 13; ++f) SeesSomethingElse(4, f);
  Remove();
  EXPECT_FALSE(IsThere(5));
  EXPECT_TRUE(IsThere(4));
}

TEST_F(RedundantKeyframes, ViewsFromFartherAwayDoNotReplaceNearerOnes) {
  const auto with_octave = [this](int keyframe, int octave) {
    auto features = std::make_shared<FrameFeatures>(*std::as_const(map_).keyframe(keyframe).features);
    for (cv::KeyPoint& keypoint : features->keypoints) keypoint.octave = octave;
    map_.keyframe(keyframe).features = features;
  };
  for (const int coarser : {0, 1, 2}) with_octave(coarser, 3);
  Remove();
  EXPECT_TRUE(IsThere(5)) << "two others see as much";
}

// A place seen by a keyframe, and `between` ones elsewhere later by another, which has `own` landmarks that
// are new. The removed ones.
std::map<int, int> SeenAgain(int between, std::size_t least_views, int own = 0) {
  Map map({1.0F, 1.2F, 1.44F, 1.728F});
  const int first = map.AddKeyframe(KeyframeAt(0));
  for (int k = 0; k < between; ++k) map.AddKeyframe(KeyframeAt(5));
  const int again = map.AddKeyframe(KeyframeAt(0.1));
  for (int f = 0; f < kFeaturesEach; ++f) {
    const int landmark = map.AddLandmark({0, 0, 5}, f < own ? again : first, f);
    if (f >= own) map.AddObservation(landmark, again, f);
  }
  return Prune(
      {}, least_views, [](int, int) { return true; }, &map);
}

TEST_F(RedundantKeyframes, AnEarlierVisitThatSawTheSameIsEnough) {
  const std::map<int, int> second_visit = {{2, 0}};
  EXPECT_EQ(SeenAgain(1, 1), second_visit);
  EXPECT_TRUE(SeenAgain(1, 2).empty()) << "one camera needs two views to tell where a landmark is";
  EXPECT_TRUE(SeenAgain(0, 1).empty()) << "the same visit";
}

TEST_F(RedundantKeyframes, OfAPlaceThatWasSeenBeforeThreeTenthsMayBeNew) {
  const std::map<int, int> second_visit = {{2, 0}};
  EXPECT_EQ(SeenAgain(1, 1, 12), second_visit) << "corners that noise made";
  EXPECT_TRUE(SeenAgain(1, 1, 13).empty());
}

TEST_F(RedundantKeyframes, TheFirstOfAPieceAndThoseToBeKeptStay) {
  for (const int id : {3, 4, 5}) map_.keyframe(id).piece = 1;
  EXPECT_EQ(Remove({4}), (std::map<int, int>{{5, 3}, {2, 0}, {1, 0}})) << "each in its piece";
}

TEST_F(RedundantKeyframes, WhoeverNeedsOneCanForbidIt) {
  may_ = [](int removed, int) { return removed != 5; };
  EXPECT_EQ(Remove(), (std::map<int, int>{{4, 0}, {3, 0}, {2, 0}}));
}

TEST_F(RedundantKeyframes, WhereTheFirstMayNotStandForOneTheNextDoes) {
  may_ = [](int removed, int into) { return removed != 5 || into >= 2; };
  EXPECT_EQ(Remove(), (std::map<int, int>{{5, 2}, {4, 0}, {3, 0}}));
}

}  // namespace
}  // namespace tutti
