#include "frontend/odometry/pose_search.h"

#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgproc.hpp>

#include "tests/frontend/odometry/tracked_scene.h"
#include "tests/support/plain_camera.h"

namespace tutti {
namespace {

using testing::Distance;
using testing::Moved;

class PoseSearchTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  std::optional<PoseFix> Find(const TrackedFrame& frame, const LastFrame& last, bool lost = false) const {
    return PoseSearch(options_, Rig()).Find(map_, frame, last, lost);
  }
  OdometryOptions options_;
};

TEST_F(PoseSearchTest, FindsAFrameNearTheLastOne) {
  const Pose T_world_camera = Moved(0.1, 0.05, 0.01);
  const TrackedFrame frame = Frame(T_world_camera, 0.1);
  const auto fix = Find(frame, AtFirstKeyframe());
  ASSERT_TRUE(fix);
  EXPECT_LT(Distance(fix->T_camera_world, T_world_camera.Inverse()), 1e-5);
  EXPECT_EQ(fix->reference, 0);
  EXPECT_GT(fix->inliers, 200);
  EXPECT_EQ(fix->frame.features, frame.features) << "no patch to align with";
  EXPECT_GE(fix->visible.size(), static_cast<std::size_t>(fix->inliers));
  EXPECT_LE(fix->Share(), 1);
}

TEST_F(PoseSearchTest, GoesOnWithTheVelocityWhereTheLastPoseIsTooFarAway) {
  std::vector<int> order;
  for (int i = 0; i < 12; ++i) AddKeyframe(Pose(), &order);  // without landmarks: no help
  LastFrame last = AtFirstKeyframe();
  last.reference = last.newest_keyframe = 12;
  const Pose T_world_camera = Moved(0, 0, 0.3);  // 130 px in the image
  EXPECT_FALSE(Find(Frame(T_world_camera, 0.2), last));
  last.velocity = LogSE3(T_world_camera.Inverse()) / 0.2;
  const auto fix = Find(Frame(T_world_camera, 0.2), last);
  ASSERT_TRUE(fix);
  EXPECT_LT(Distance(fix->T_camera_world, T_world_camera.Inverse()), 1e-5);
  EXPECT_TRUE(Find(Frame(Pose(), 0.2), last)) << "or it has stopped";
}

TEST_F(PoseSearchTest, FindsAFrameFarFromTheMotionByItsKeyframe) {
  const Pose T_world_camera = Moved(0.3, 0, 0.4);
  const auto fix = Find(Frame(T_world_camera, 0.1), AtFirstKeyframe());
  ASSERT_TRUE(fix);
  EXPECT_LT(Distance(fix->T_camera_world, T_world_camera.Inverse()), 1e-5);
}

TEST_F(PoseSearchTest, WhatNobodyHasSeenIsNowhere) {
  EXPECT_FALSE(Find(Elsewhere(0.1), AtFirstKeyframe()));
  EXPECT_FALSE(PoseSearch(options_, Rig()).FindAt(map_, Elsewhere(0.1), 0));
}

TEST_F(PoseSearchTest, AFrameWithoutFeaturesIsNowhere) {
  EXPECT_FALSE(Find(Nothing(0.1), AtFirstKeyframe()));
  EXPECT_FALSE(PoseSearch(options_, Rig()).FindAt(map_, Nothing(0.1), 0));
}

TEST_F(PoseSearchTest, AfterAFrameThatHadNothingToSeeTheKeyframeHelps) {
  LastFrame last = AtFirstKeyframe();
  last.frame = Nothing(0);
  last.matches = {last.frame.features.get(), {}};
  EXPECT_TRUE(Find(Frame(Pose(), 0.1), last));
}

TEST_F(PoseSearchTest, ALostFrameNeedsTwiceTheLandmarks) {
  const TrackedFrame frame = Frame(Moved(0.1, 0), 0.1);
  const auto fix = Find(frame, AtFirstKeyframe());
  ASSERT_TRUE(fix);
  options_.min_inliers = 2 * fix->inliers / 3;
  EXPECT_TRUE(Find(frame, AtFirstKeyframe(), false));
  EXPECT_FALSE(Find(frame, AtFirstKeyframe(), true));
  EXPECT_FALSE(PoseSearch(options_, Rig()).FindAt(map_, frame, 0)) << "nor is it believed at a keyframe";
}

TEST_F(PoseSearchTest, FindsAFrameAtAKeyframeThatExists) {
  const Pose T_world_camera = Moved(0.3, 0, 0.4);
  const TrackedFrame frame = Frame(T_world_camera, 0.1);
  const PoseSearch search(options_, Rig());
  const auto fix = search.FindAt(map_, frame, 0);
  ASSERT_TRUE(fix);
  EXPECT_LT(Distance(fix->T_camera_world, T_world_camera.Inverse()), 1e-5);
  for (const int no_such : {-1, 1, 1000000}) EXPECT_FALSE(search.FindAt(map_, frame, no_such)) << no_such;
}

TEST_F(PoseSearchTest, AnEmptyMapHasNoPlace) {
  const Map empty(PyramidScales(options_));
  const PoseSearch search(options_, Rig());
  EXPECT_FALSE(search.Find(empty, Frame(Pose(), 0), LastFrame(), false));
  EXPECT_FALSE(search.FindAt(empty, Frame(Pose(), 0), 0));
}

TEST_F(PoseSearchTest, AFrameWhoseStampIsNoNumberIsFoundAllTheSame) {
  for (const double stamp_s :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
        -std::numeric_limits<double>::infinity()}) {
    LastFrame last = AtFirstKeyframe();
    last.velocity = Vector6d::Constant(0.3);
    TrackedFrame frame = Frame(Moved(0.1, 0), 0.1);
    frame.stamp_s = stamp_s;
    const auto fix = Find(frame, last);
    ASSERT_TRUE(fix) << stamp_s;
    EXPECT_LT(Distance(fix->T_camera_world, Moved(0.1, 0).Inverse()), 1e-5) << stamp_s;
  }
}

// A lorry drives along: it holds a third of the landmarks, and says that the camera has not moved on.
TEST_F(PoseSearchTest, AFewLandmarksDoNotCarryTheCameraFartherThanItCanMove) {
  const Pose by_lorry = Moved(0.3, -1.0);
  const auto seen = std::make_shared<FrameFeatures>(*Frame(by_lorry, 0.1).features);
  seen->descriptors = seen->descriptors.clone();
  cv::RNG(77).fill(seen->descriptors.rowRange(seen->descriptors.rows / 3, seen->descriptors.rows),
                   cv::RNG::UNIFORM, 0, 256);
  TrackedFrame frame = Frame(by_lorry, 0.1);
  frame.features = seen;
  const auto find = [&](Sensor sensor, const LastFrame& last) {
    return PoseSearch(options_, Rig(sensor)).Find(map_, frame, last, false);
  };
  LastFrame last = AtFirstKeyframe();
  const auto fix = find(Sensor::kStereo, last);
  ASSERT_TRUE(fix) << "nothing is known of the motion";
  EXPECT_LT(fix->Share(), 0.5);
  EXPECT_LT(Distance(fix->T_camera_world, by_lorry.Inverse()), 1e-4);
  last.velocity = LogSE3(Moved(0, 0.16).Inverse()) / 0.1;
  EXPECT_TRUE(find(Sensor::kStereo, last)) << "one step may have been a wrong one";
  last.steady = true;
  EXPECT_FALSE(find(Sensor::kStereo, last)) << "1.2 m off after 0.1 s";
  EXPECT_TRUE(find(Sensor::kMono, last)) << "one camera has no metres";
  frame.stamp_s = 2;
  EXPECT_TRUE(find(Sensor::kStereo, last)) << "it may be anywhere by now";
  frame = Frame(by_lorry, 0.1);
  EXPECT_TRUE(find(Sensor::kStereo, last)) << "all landmarks say so";
}

// The map is thin, and so much of it is new that too few landmarks are left; they are where they should be.
TEST_F(PoseSearchTest, OneCameraIsFoundByAFewLandmarksLessWhereItsMotionLeads) {
  for (int l = 60; l < map_.LandmarkCount(); ++l) map_.RemoveLandmark(l);
  const Pose there = Moved(0, 0.1);
  LastFrame last = AtFirstKeyframe();
  last.matches.landmarks = map_.keyframe(0).landmarks;
  last.velocity = LogSE3(there.Inverse()) / 0.1;
  const auto find = [&](int known, Sensor sensor, bool lost) {
    TrackedFrame frame = Frame(there, 0.1);
    const auto seen = std::make_shared<FrameFeatures>(*frame.features);
    seen->descriptors = seen->descriptors.clone();
    cv::RNG(77).fill(seen->descriptors.rowRange(known, seen->descriptors.rows), cv::RNG::UNIFORM, 0, 256);
    frame.features = seen;
    return PoseSearch(options_, Rig(sensor)).Find(map_, frame, last, lost);
  };
  ASSERT_TRUE(find(25, Sensor::kMono, false));
  EXPECT_FALSE(find(18, Sensor::kMono, false)) << "the motion is not sure";
  last.steady = true;
  const auto fix = find(18, Sensor::kMono, false);
  ASSERT_TRUE(fix);
  EXPECT_LT(fix->inliers, options_.min_inliers);
  EXPECT_LT(Distance(fix->T_camera_world, there.Inverse()), 1e-4);
  EXPECT_FALSE(find(15, Sensor::kMono, false)) << "few are few";
  EXPECT_FALSE(find(18, Sensor::kMono, true)) << "it was lost";
  EXPECT_FALSE(find(18, Sensor::kStereo, false));
  last.velocity = LogSE3(Moved(0, 1).Inverse()) / 0.1;
  EXPECT_FALSE(find(18, Sensor::kMono, false)) << "it is expected elsewhere";
}

TEST_F(PoseSearchTest, RefineDropsWhatDoesNotFit) {
  const Pose T_world_camera = Moved(0.1, 0.05, 0.01);
  const TrackedFrame frame = Frame(Pose(), 0.1);
  FrameMatches matches{frame.features.get(), map_.keyframe(0).landmarks};
  std::swap(matches.landmarks[3], matches.landmarks[90]);
  Pose pose = T_world_camera.Inverse();
  const int count = static_cast<int>(matches.landmarks.size());
  EXPECT_EQ(PoseSearch(options_, Rig()).Refine(map_, &matches, &pose), count - 2);
  EXPECT_LT(Distance(pose, Pose()), 1e-5);
  EXPECT_EQ(matches.landmarks[3], -1);
  EXPECT_EQ(matches.landmarks[90], -1);
  EXPECT_EQ(matches.landmarks[4], 4);
}

TEST_F(PoseSearchTest, RefineLeavesAPoseThatTooFewMatchesHold) {
  const TrackedFrame frame = Frame(Pose(), 0.1);
  FrameMatches matches{frame.features.get(), std::vector<int>(frame.features->size(), -1)};
  for (std::size_t f = 0; f < 5; ++f) matches.landmarks[f] = static_cast<int>(f);
  Pose pose = Moved(1, 2);
  EXPECT_EQ(PoseSearch(options_, Rig()).Refine(map_, &matches, &pose), 0);
  EXPECT_EQ(pose.Matrix(), Moved(1, 2).Matrix());
}

// A wall of equal windows, whose corners all look alike.
class PoseSearchOfWindows : public ::testing::Test {
 protected:
  static constexpr double kWallDepth = 5;  // [m]
  static constexpr int kWindowPx = 9;

  // The wall as it is `shift_px` further left, and those of its corners whose window has a number that
  // counts.
  template <class Counts>
  std::shared_ptr<FrameFeatures> Frame(double shift_px, const Counts& counts) const {
    cv::Mat window(camera_.height, kWindowPx, CV_8U), wall(camera_.height, camera_.width + 160, CV_8U), image;
    cv::RNG(5).fill(window, cv::RNG::UNIFORM, 0, 256);
    for (int x = 0; x < wall.cols; ++x) window.col(x % kWindowPx).copyTo(wall.col(x));
    cv::GaussianBlur(wall, wall, {}, 1.5);
    cv::normalize(wall, wall, 20, 220, cv::NORM_MINMAX);
    cv::warpAffine(wall, image, cv::Matx23d(1, 0, -80 - shift_px, 0, 1, 0), {camera_.width, camera_.height},
                   cv::INTER_CUBIC);
    const auto pyramid = std::make_shared<const Pyramid>(BuildPyramid(image, options_));
    const FrameFeatures all = ExtractOrb(pyramid->Levels(), options_);
    auto features = std::make_shared<FrameFeatures>();
    for (std::size_t f = 0; f < all.size(); ++f) {
      const cv::KeyPoint& k = all.keypoints[f];
      if (k.octave > 1 || !counts(static_cast<int>((k.pt.x + 80 + shift_px) / kWindowPx))) continue;
      features->keypoints.push_back(k);
      features->descriptors.push_back(all.descriptors.row(static_cast<int>(f)));
    }
    features->inverse_depth.assign(features->size(), 0);
    features->inverse_depth_sigma.assign(features->size(), 0);
    features->aligned.assign(features->size(), -1);
    features->BuildGrid(camera_.width, camera_.height);
    features->pyramid = pyramid;
    return features;
  }

  const PinholeCamera camera_ = testing::PlainCamera(450);
  OdometryOptions options_;
};

TEST_F(PoseSearchOfWindows, TheMotionTellsWhichOneItIsWhereCornersSayTheNext) {
  CameraRig rig;
  rig.camera = camera_;
  Map map(PyramidScales(options_), rig, options_.aligned_sigma);
  Keyframe keyframe;
  keyframe.features = Frame(0, [](int window) { return window % 3 == 0; });
  map.AddKeyframe(keyframe);
  for (int f = 0; f < static_cast<int>(keyframe.features->size()); ++f) {
    const cv::Point2f& p = keyframe.features->keypoints[static_cast<std::size_t>(f)].pt;
    map.UpdateLandmark(map.AddLandmark(kWallDepth * camera_.Unproject({p.x, p.y}), 0, f));
  }
  LastFrame last;
  last.frame = {0, 0, map.keyframe(0).features};
  last.matches = {last.frame.features.get(), map.keyframe(0).landmarks};
  last.reference = last.newest_keyframe = 0;
  for (const double shift_px : {6.0, 12.0, 30.0}) {
    // Of three corners that were seen one is not found again; those of the windows beside them all are.
    const auto frame = Frame(shift_px, [](int w) { return w % 3 == 2 || w % 9 == 0 || w % 9 == 3; });
    // The camera goes to the right by this; the velocity is a pixel wrong.
    last.velocity.emplace(Vector6d::Zero());
    last.velocity->x() = -(shift_px + 1) * kWallDepth / camera_.fx / 0.1;
    const auto fix = PoseSearch(options_, rig).Find(map, {1, 0.1, frame}, last, false);
    ASSERT_TRUE(fix) << shift_px;
    EXPECT_NEAR(-fix->T_camera_world.translation.x() * camera_.fx / kWallDepth, shift_px, 0.2);
  }
}

}  // namespace
}  // namespace tutti
