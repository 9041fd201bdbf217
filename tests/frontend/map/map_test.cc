#include "tutti/frontend/map.h"

#include <gtest/gtest.h>

#include <set>
#include "frontend/features/features.h"

namespace tutti {
namespace {

// A keyframe with `count` features in octave 0, each with a descriptor full of `fill`.
Keyframe MakeKeyframe(double x, int count = 20, std::uint8_t fill = 0) {
  auto features = std::make_shared<FrameFeatures>();
  features->keypoints.assign(static_cast<std::size_t>(count), cv::KeyPoint(10.0F, 10.0F, 31.0F));
  for (cv::KeyPoint& keypoint : features->keypoints) keypoint.octave = 0;
  features->descriptors = cv::Mat(count, 32, CV_8U, cv::Scalar(fill));
  features->inverse_depth.assign(static_cast<std::size_t>(count), 0.0F);
  features->inverse_depth_sigma.assign(static_cast<std::size_t>(count), 0.0F);
  Keyframe keyframe;
  keyframe.features = features;
  keyframe.T_world_camera.translation.x() = x;
  return keyframe;
}

Map ThreeKeyframes() {
  Map map({1.0F, 1.2F, 1.44F});
  for (int i = 0; i < 3; ++i) map.AddKeyframe(MakeKeyframe(i));
  return map;
}

// Landmarks count as many as are shared; recounted from scratch.
void ExpectConsistent(const Map& map) {
  std::map<std::pair<int, int>, int> shared;
  for (int l = 0; l < map.LandmarkCount(); ++l) {
    const Landmark& landmark = map.landmark(l);
    EXPECT_EQ(landmark.alive, !landmark.observations.empty());
    for (const Observation& a : landmark.observations) {
      EXPECT_EQ(map.keyframe(a.keyframe).landmarks[static_cast<std::size_t>(a.feature)], l);
      for (const Observation& b : landmark.observations) {
        if (a.keyframe != b.keyframe) ++shared[{a.keyframe, b.keyframe}];
      }
    }
  }
  std::map<std::pair<int, int>, int> kept;
  for (int id = 0; id < map.KeyframeCount(); ++id) {
    for (const auto& [other, count] : map.keyframe(id).covisible) kept[{id, other}] = count;
  }
  EXPECT_EQ(kept, shared);
}

TEST(Map, CovisibilityCountsCommonLandmarks) {
  Map map = ThreeKeyframes();
  for (int i = 0; i < 6; ++i) {
    const int l = map.AddLandmark({0, 0, 5}, 0, i);
    map.AddObservation(l, 1, i);
    if (i < 2) map.AddObservation(l, 2, i);
  }
  ExpectConsistent(map);
  EXPECT_EQ(map.keyframe(0).covisible.at(1), 6);
  EXPECT_EQ(map.BestCovisible(0, 5, 1), (std::vector<int>{1, 2}));
  EXPECT_EQ(map.BestCovisible(0, 5, 3), std::vector<int>{1});
  EXPECT_EQ(map.BestCovisible(0, 1, 1), std::vector<int>{1});
}

TEST(Map, LandmarksOfSomeKeyframesComeOnceEachInAscendingOrder) {
  Map map({1.0F, 1.2F, 1.44F});
  for (int i = 0; i < 3; ++i) map.AddKeyframe(MakeKeyframe(i, 200));
  std::set<int> of_both;
  for (int i = 0; i < 300; ++i) {  // more than a machine word has bits
    const int keyframe = i * 7 % 3;
    const int l = map.AddLandmark({0, 0, 5}, keyframe, 199 - i / 3);
    if (i % 5 == 0) map.AddObservation(l, (keyframe + 1) % 3, i / 5);
    for (const Observation& seen : map.landmark(l).observations) {
      if (seen.keyframe != 1) of_both.insert(l);
    }
  }
  const std::vector<int> landmarks = map.LandmarksOf({2, 0});
  EXPECT_GT(landmarks.size(), 200U);
  EXPECT_EQ(landmarks, std::vector<int>(of_both.begin(), of_both.end()));
  EXPECT_TRUE(map.LandmarksOf({}).empty());
}

TEST(Map, OneKeyframeSeesALandmarkOnce) {
  Map map = ThreeKeyframes();
  const int l = map.AddLandmark({0, 0, 5}, 0, 3);
  map.AddObservation(l, 0, 4);
  EXPECT_EQ(map.landmark(l).observations.size(), 1U);
  EXPECT_EQ(map.keyframe(0).landmarks[4], -1);
  ExpectConsistent(map);
}

TEST(Map, LastObservationTakesTheLandmarkWithIt) {
  Map map = ThreeKeyframes();
  const int l = map.AddLandmark({0, 0, 5}, 0, 3);
  map.AddObservation(l, 2, 7);
  map.RemoveObservation(l, 0);
  EXPECT_TRUE(map.landmark(l).alive);
  EXPECT_EQ(map.landmark(l).reference, 2) << "the keyframe that made it no longer sees it";
  map.RemoveObservation(l, 1);  // never saw it
  map.RemoveObservation(l, 2);
  EXPECT_FALSE(map.landmark(l).alive);
  ExpectConsistent(map);
}

TEST(Map, MergeHandsOverAllThatTheLoserSees) {
  Map map = ThreeKeyframes();
  const int a = map.AddLandmark({0, 0, 5}, 0, 1), b = map.AddLandmark({0, 0, 5.1}, 1, 2);
  map.AddObservation(b, 2, 3);
  map.AddObservation(a, 2, 4);  // both in keyframe 2: the winner's own feature stays
  map.ReplaceLandmark(b, a);
  EXPECT_FALSE(map.landmark(b).alive);
  ASSERT_EQ(map.landmark(a).observations.size(), 3U);
  EXPECT_EQ(map.landmark(a).observations[1].keyframe, 1);
  EXPECT_EQ(map.keyframe(2).landmarks[4], a);
  EXPECT_EQ(map.keyframe(2).landmarks[3], -1);
  map.ReplaceLandmark(a, a);
  EXPECT_TRUE(map.landmark(a).alive);
  ExpectConsistent(map);
}

TEST(Map, UpdateTakesTheMostCentralDescriptorAndTheMeanDirection) {
  Map map({1.0F, 1.2F});
  const std::uint8_t fills[] = {0x00, 0x01, 0x03, 0x1f, 0xff};  // 0x01 is nearest to the most
  for (int i = 0; i < 5; ++i) map.AddKeyframe(MakeKeyframe(i - 2, 20, fills[i]));
  const int l = map.AddLandmark({0, 0, 4}, 0, 0);
  for (int i = 1; i < 5; ++i) map.AddObservation(l, i, 0);
  map.UpdateLandmark(l);
  EXPECT_EQ(map.landmark(l).descriptor[5], 0x01);
  EXPECT_NEAR(map.landmark(l).normal.z(), 1, 1e-9);
  const double distance = std::sqrt(20.0);
  EXPECT_NEAR(map.landmark(l).max_distance, distance, 1e-5);
  EXPECT_NEAR(map.landmark(l).min_distance, distance / 1.2, 1e-5);
}

TEST(Map, CopyIsIndependent) {
  Map map = ThreeKeyframes();
  const int l = map.AddLandmark({0, 0, 5}, 0, 3);
  Map copy = map;
  copy.RemoveLandmark(l);
  copy.keyframe(0).T_world_camera.translation.x() = 9;
  EXPECT_TRUE(map.landmark(l).alive);
  EXPECT_EQ(map.keyframe(0).T_world_camera.translation.x(), 0);
  ExpectConsistent(map);
  ExpectConsistent(copy);
}

TEST(Map, MedianDepthOfNothingIsZero) {
  Map map = ThreeKeyframes();
  EXPECT_EQ(map.MedianDepth(0), 0);
  for (int i = 0; i < 3; ++i) map.AddLandmark({0, 0, 2.0 + i}, 0, i);
  EXPECT_EQ(map.MedianDepth(0), 3);
}

TEST(Map, ARemovedKeyframeLeavesWhatItSawToTheOthersAndAnEmptyShell) {
  Map map = ThreeKeyframes();
  const int all = map.AddLandmark({0, 0, 5}, 2, 0), pair = map.AddLandmark({0, 0, 5}, 2, 1),
            alone = map.AddLandmark({0, 0, 5}, 2, 2);
  for (const int keyframe : {0, 1}) map.AddObservation(all, keyframe, 0);
  map.AddObservation(pair, 1, 1);
  map.RemoveKeyframe(2, 1, 2);
  ExpectConsistent(map);
  EXPECT_EQ(map.landmark(all).observations.size(), 2U);
  EXPECT_EQ(map.landmark(all).reference, 0) << "the keyframe that made it is gone";
  EXPECT_FALSE(map.landmark(pair).alive) << "one view is less than two";
  EXPECT_FALSE(map.landmark(alone).alive);
  EXPECT_EQ(map.keyframe(2).features->size(), 0U);
  EXPECT_EQ(map.KeyframeCount(), 3) << "ids stay";
  map.RemoveKeyframe(1, 0, 1);
  EXPECT_EQ(map.PresentKeyframe(2), 0);
  EXPECT_EQ(map.PresentKeyframe(0), 0);
  EXPECT_TRUE(map.landmark(all).alive) << "one view is enough";
  ExpectConsistent(map);
}

}  // namespace
}  // namespace tutti
