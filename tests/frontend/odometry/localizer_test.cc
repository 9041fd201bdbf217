#include "frontend/odometry/localizer.h"

#include <gtest/gtest.h>

#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

// A map of one keyframe, and a frame that sees all that it has.
class LocalizerTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  LocalizerTest() { localizer_.Begin(map_); }

  int Count() const { return static_cast<int>(order_.size()); }

  // A frame that so many landmarks agree with, of those that should be in view: all of them.
  PoseFix Fix(int inliers) const {
    PoseFix fix(Frame(Pose(), 0.1, true));
    for (int f = 0; f < inliers; ++f) fix.matches.landmarks[static_cast<std::size_t>(f)] = f;
    for (int l = 0; l < Count(); ++l) fix.visible.push_back(l);
    fix.reference = 0;
    fix.inliers = inliers;
    return fix;
  }

  // A second keyframe, with landmarks of its own for what the first one sees; it is none of the map's.
  int ExtendMap() {
    std::vector<int> order;
    const int id = AddKeyframe(Pose(), &order);
    const int first = map_.LandmarkCount();
    for (int f = 0; f < static_cast<int>(order.size()); ++f)
      map_.AddLandmark(points_[static_cast<std::size_t>(order[static_cast<std::size_t>(f)])], id, f);
    return first;
  }

  OdometryOptions options_;
  Localizer localizer_{options_, Rig(Sensor::kRgbd)};
};

TEST_F(LocalizerTest, BeforeItBeginsNothingIsBeyondAndAllFeaturesAreNeeded) {
  Localizer idle(options_, Rig(Sensor::kRgbd));
  EXPECT_FALSE(idle.Begun());
  idle.Found(Fix(Count()), map_);
  EXPECT_FALSE(idle.Beyond());
  EXPECT_EQ(idle.features(), options_.features);
}

TEST_F(LocalizerTest, AFrameHangsOnTheKeyframeOfTheMapThatSharesMostLandmarksWithIt) {
  std::vector<int> order;
  const int second = AddKeyframe(Pose(), &order);
  for (int l = 0; l < 100; ++l) map_.AddObservation(l, second, l);
  localizer_.Begin(map_);
  localizer_.Found(Fix(Count()), map_);
  EXPECT_EQ(localizer_.keyframe(), 0);
  localizer_.Found(Fix(100), map_);
  EXPECT_EQ(localizer_.keyframe(), second) << "as many as the older one";
}

TEST_F(LocalizerTest, WhatWasSeenSinceCountsForNothing) {
  const int first = ExtendMap();
  PoseFix fix = Fix(Count());
  for (int f = 39; f < Count(); ++f) fix.matches.landmarks[static_cast<std::size_t>(f)] = first + f;
  localizer_.Found(fix, map_);
  EXPECT_TRUE(localizer_.Beyond()) << "39 of the map's landmarks; a lost frame needs twice 20";
  EXPECT_EQ(localizer_.keyframe(), -1);
  fix.matches.landmarks[39] = 39;
  localizer_.Found(fix, map_);
  EXPECT_FALSE(localizer_.Beyond());
  EXPECT_EQ(localizer_.keyframe(), 0) << "though the newer keyframe shares more with it";
}

TEST_F(LocalizerTest, ALostFrameSaysNothingOfWhereTheLastOneWas) {
  localizer_.Found(Fix(Count()), map_);
  localizer_.Lost();
  EXPECT_FALSE(localizer_.Beyond());
  EXPECT_EQ(localizer_.keyframe(), 0);
}

TEST_F(LocalizerTest, ManyLandmarksNeedFewerFeaturesUntilAFrameIsLost) {
  options_.features = Count();
  localizer_ = Localizer(options_, Rig(Sensor::kRgbd));
  localizer_.Begin(map_);
  EXPECT_EQ(localizer_.features(), Count());
  PoseFix fix = Fix(Count());
  fix.inliers = 250;
  localizer_.Found(fix, map_);
  EXPECT_EQ(localizer_.features(), Count() * 200 / 250);
  fix.inliers = 100000;
  localizer_.Found(fix, map_);
  EXPECT_EQ(localizer_.features(), Count() / 3) << "at least";
  fix.inliers = 150;
  localizer_.Found(fix, map_);
  EXPECT_EQ(localizer_.features(), Count()) << "at most";
  fix.inliers = 250;
  localizer_.Found(fix, map_);
  localizer_.Lost();
  EXPECT_EQ(localizer_.features(), Count());
}

TEST_F(LocalizerTest, TheMapIsExtendedWhereTooFewLandmarksAreLeft) {
  ASSERT_GT(Count(), 200);
  EXPECT_FALSE(localizer_.MustExtend(Fix(Count()), 5));
  EXPECT_FALSE(localizer_.MustExtend(Fix(120), 5));
  EXPECT_TRUE(localizer_.MustExtend(Fix(119), 5));
  EXPECT_FALSE(localizer_.MustExtend(Fix(119), 1)) << "keyframe_min_frames is 2";
  EXPECT_TRUE(localizer_.MustExtend(Fix(59), 1)) << "three times the fewest inliers: at once";
  const Localizer mono(options_, Rig(Sensor::kMono));  // new landmarks need parallax
  EXPECT_FALSE(mono.MustExtend(Fix(60), 5));
  EXPECT_TRUE(mono.MustExtend(Fix(59), 5));
}

TEST_F(LocalizerTest, TheMapIsExtendedWhereMostOfWhatShouldBeInViewIsNotThere) {
  options_.min_inliers = 8;
  const Localizer mono(options_, Rig(Sensor::kMono));
  const int few = Count() * 19 / 100;
  ASSERT_GT(few, 24);
  EXPECT_TRUE(mono.MustExtend(Fix(few), 2));
  EXPECT_FALSE(mono.MustExtend(Fix(few), 1)) << "keyframe_min_frames is 2";
  EXPECT_FALSE(mono.MustExtend(Fix(Count() * 22 / 100), 2));
}

TEST_F(LocalizerTest, NothingExtendsTheMapWithoutLandmarksOrTheDepthThatMakesThem) {
  PoseFix fix = Fix(30);
  fix.by_grey = true;
  EXPECT_FALSE(localizer_.MustExtend(fix, 5));
  EXPECT_TRUE(localizer_.Doubts(fix, 5)) << "more features may find landmarks";
  fix = Fix(30);
  auto colour_alone = std::make_shared<FrameFeatures>(*fix.frame.features);
  colour_alone->has_depth = false;
  fix.frame.features = colour_alone;
  EXPECT_FALSE(localizer_.MustExtend(fix, 5));
  EXPECT_TRUE(Localizer(options_, Rig(Sensor::kMono)).MustExtend(fix, 5));
}

}  // namespace
}  // namespace tutti
