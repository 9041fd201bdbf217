#include "frontend/odometry/keyframe_policy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <ostream>

#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

using testing::Moved;

// Two keyframes at the origin see the same landmarks; the frame in question is where they are.
class KeyframePolicyTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  KeyframePolicyTest() {
    SeeAllAgain(0);
    last_.newest_keyframe = 1;
    last_.frames_since_keyframe = 5;
  }

  void SeeAllAgain(double stamp_s) {
    std::vector<int> order;
    const int id = AddKeyframe(Pose(), &order);
    map_.keyframe(id).stamp_s = stamp_s;
    for (int l = 0; l < Count(); ++l) map_.AddObservation(l, id, l);
  }
  int Count() const { return static_cast<int>(order_.size()); }

  // A frame that sees all landmarks, with that share of inliers.
  PoseFix Fix(double share, double stamp_s = 0.1, bool depth = false) const {
    PoseFix fix(Frame(Pose(), stamp_s, depth));
    fix.matches.landmarks = map_.keyframe(0).landmarks;
    fix.reference = 0;
    fix.inliers = static_cast<int>(share * Count());
    return fix;
  }
  KeyframeNeed Need(const PoseFix& fix, Sensor sensor = Sensor::kMono) const {
    return KeyframePolicy(options_, Rig(sensor)).Need(map_, fix, last_);
  }

  OdometryOptions options_;
  LastFrame last_ = AtFirstKeyframe();
};

TEST_F(KeyframePolicyTest, NoneWhileTheMapShowsEnough) { EXPECT_EQ(Need(Fix(1)), KeyframeNeed::kNone); }

TEST_F(KeyframePolicyTest, WhenTooSmallAShareOfTheReferenceIsSeen) {
  EXPECT_EQ(Need(Fix(0.8)), KeyframeNeed::kNone);
  EXPECT_EQ(Need(Fix(0.7)), KeyframeNeed::kWeak);
  options_.keyframe_inlier_ratio = 0.9;
  EXPECT_EQ(Need(Fix(0.8)), KeyframeNeed::kWeak);
}

TEST_F(KeyframePolicyTest, WhatGreyValuesAlonePoseIsOneIfItIsSharpAndHasDepth) {
  PoseFix fix = Fix(0, 0.1, true);
  fix.by_grey = true;
  EXPECT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kNone) << "blurred";
  fix.sharp = true;
  EXPECT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kVeryWeak);
  EXPECT_EQ(Need(fix, Sensor::kMono), KeyframeNeed::kNone) << "one camera knows no depths of what is new";
  auto features = std::make_shared<FrameFeatures>(*fix.frame.features);
  features->has_depth = false;
  fix.frame.features = features;
  EXPECT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kNone);
}

TEST_F(KeyframePolicyTest, WhatOneKeyframeAloneHasSeenDoesNotCount) {
  for (int l = 0; l < Count() / 2; ++l) map_.RemoveObservation(l, 1);
  std::fill_n(last_.matches.landmarks.begin(), Count() / 2, -1);
  EXPECT_EQ(Need(Fix(0.5)), KeyframeNeed::kNone) << "half of the landmarks are all that is established";
  SeeAllAgain(0);
  for (int l = 0; l < Count() / 2; ++l) map_.RemoveObservation(l, 2);
  EXPECT_EQ(Need(Fix(0.5), Sensor::kRgbd), KeyframeNeed::kNone);
}

TEST_F(KeyframePolicyTest, SoonAfterAKeyframeOnlyIfTrackingIsAboutToBeLost) {
  last_.frames_since_keyframe = 0;
  EXPECT_EQ(Need(Fix(0.7)), KeyframeNeed::kNone);
  EXPECT_EQ(Need(Fix(0.35)), KeyframeNeed::kVeryWeak);
  last_.frames_since_keyframe = 1;
  EXPECT_EQ(Need(Fix(0.7)), KeyframeNeed::kWeak) << "keyframe_min_frames is 2";
}

TEST_F(KeyframePolicyTest, FewInliersAreFewWhateverTheirShare) {
  options_.min_inliers = Count() / 3 + 1;
  EXPECT_EQ(Need(Fix(1)), KeyframeNeed::kVeryWeak);
}

TEST_F(KeyframePolicyTest, AFrameThatSeesNothingIsVeryWeak) {
  PoseFix fix(Nothing(0.1));
  fix.reference = 0;
  EXPECT_EQ(Need(fix), KeyframeNeed::kThin);
  EXPECT_EQ(Need(fix, Sensor::kStereo), KeyframeNeed::kVeryWeak);
}

TEST_F(KeyframePolicyTest, NeverWithoutTheDepthThatTheSensorShouldHave) {
  PoseFix fix = Fix(0.35);
  ASSERT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kVeryWeak);
  auto colour_alone = std::make_shared<FrameFeatures>(*fix.frame.features);
  colour_alone->has_depth = false;
  fix.frame.features = colour_alone;
  EXPECT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kNone);
  EXPECT_EQ(Need(fix, Sensor::kStereo), KeyframeNeed::kNone);
  EXPECT_EQ(Need(fix, Sensor::kMono), KeyframeNeed::kVeryWeak);
}

TEST_F(KeyframePolicyTest, WithDepthWhenFewLandmarksAreNear) {
  PoseFix fix = Fix(1, 0.1, true);
  for (std::size_t f = 90; f < fix.matches.landmarks.size(); ++f) fix.matches.landmarks[f] = -1;
  EXPECT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kFewNear);
  EXPECT_EQ(Need(fix, Sensor::kStereo), KeyframeNeed::kFewNear);
  EXPECT_EQ(Need(fix, Sensor::kMono), KeyframeNeed::kNone);
  options_.max_depth_baselines = 10;  // 2 m; all is further away
  EXPECT_EQ(Need(fix, Sensor::kStereo), KeyframeNeed::kNone);
}

TEST_F(KeyframePolicyTest, WithDepthWhenAPartOfTheImageIsUncovered) {
  PoseFix fix = Fix(1, 0.1, true);
  for (std::size_t f = 0; f < fix.matches.landmarks.size(); ++f) {
    if (fix.frame.features->keypoints[f].pt.x < 300) fix.matches.landmarks[f] = -1;
  }
  options_.keyframe_uncovered_ratio = 0.2;
  EXPECT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kUncovered);
  EXPECT_EQ(Need(fix, Sensor::kMono), KeyframeNeed::kNone);
  options_.keyframe_uncovered_ratio = 1;
  EXPECT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kNone);
}

TEST_F(KeyframePolicyTest, AfterAnIntervalIfTheCameraMoved) {
  EXPECT_EQ(Need(Fix(1, 1.5)), KeyframeNeed::kNone) << "it stands";
  last_.T_camera_world = Moved(0.3, 0).Inverse();
  EXPECT_EQ(Need(Fix(1, 1.5)), KeyframeNeed::kInterval);
  EXPECT_EQ(Need(Fix(1, 0.9)), KeyframeNeed::kNone);
  EXPECT_EQ(Need(Fix(1, std::numeric_limits<double>::quiet_NaN())), KeyframeNeed::kNone);
}

TEST_F(KeyframePolicyTest, EachFrameOfOneCameraWhoseViewMovesFarFromFrameToFrame) {
  PoseFix fix = Fix(1);
  const double width_rad = camera_.width / camera_.fx;
  fix.T_camera_world = Moved(0, 0, 0.06 * width_rad).Inverse();
  EXPECT_EQ(Need(fix), KeyframeNeed::kNone);
  fix.T_camera_world = Moved(0, 0, 0.08 * width_rad).Inverse();
  EXPECT_EQ(Need(fix), KeyframeNeed::kVeryWeak);
  EXPECT_EQ(Need(fix, Sensor::kRgbd), KeyframeNeed::kNone) << "depth makes landmarks of one view";
  fix.T_camera_world = Moved(0.08 * width_rad * map_.MedianDepth(1), 0).Inverse();
  EXPECT_EQ(Need(fix), KeyframeNeed::kVeryWeak);
}

TEST_F(KeyframePolicyTest, OneCameraLooksAheadToWhatTheNextFrameWillKeep) {
  // All that the map is sure of is seen, which is little by now.
  for (int l = 0; l < Count() / 2; ++l) map_.RemoveObservation(l, 1);
  EXPECT_EQ(Need(Fix(0.55)), KeyframeNeed::kNone);
  EXPECT_EQ(Need(Fix(0.45)), KeyframeNeed::kVeryWeak);
  options_.min_inliers = static_cast<int>(0.45 * 0.45 * Count());
  EXPECT_EQ(Need(Fix(0.45)), KeyframeNeed::kThin);
  EXPECT_EQ(Need(Fix(0.45, 1.2)), KeyframeNeed::kVeryWeak) << "long ago is no frame before";
}

TEST_F(KeyframePolicyTest, NotInAPlaceFromAnEarlierVisitUnlessTrackingIsAboutToBeLost) {
  for (int i = 0; i < 12; ++i) SeeAllAgain(20);
  last_.newest_keyframe = 13;
  EXPECT_EQ(Need(Fix(0.7, 21)), KeyframeNeed::kNone);
  EXPECT_EQ(Need(Fix(0.35, 21)), KeyframeNeed::kVeryWeak);
  EXPECT_EQ(Need(Fix(0.7, 9)), KeyframeNeed::kWeak) << "that is no earlier visit";
}

}  // namespace
}  // namespace tutti
