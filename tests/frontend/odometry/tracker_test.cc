#include "frontend/odometry/tracker.h"

#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

using testing::Distance;
using testing::Moved;

class TrackerTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  TrackerTest() { tracker_.Begin({0, 0, map_.keyframe(0).features}, std::as_const(map_).keyframe(0)); }

  Tracker::Tracked Track(const TrackedFrame& frame) { return tracker_.Track(frame, map_); }

  Tracker tracker_{OdometryOptions(), Rig()};
};

TEST_F(TrackerTest, InitialisesUntilAMapBegins) {
  Tracker fresh(OdometryOptions(), Rig());
  EXPECT_EQ(fresh.state(), TrackingState::kInitializing);
  EXPECT_EQ(fresh.last().reference, -1);
  EXPECT_EQ(tracker_.state(), TrackingState::kTracking);
  EXPECT_EQ(tracker_.last().reference, 0);
  EXPECT_EQ(tracker_.last().frames_since_keyframe, 0);
}

TEST_F(TrackerTest, FollowsTheCameraAndItsVelocity) {
  for (int i = 1; i <= 5; ++i) {
    const Pose T_world_camera = Moved(0.05 * i, 0.1 * i);
    const Tracker::Tracked tracked = Track(Frame(T_world_camera, 0.1 * i));
    ASSERT_TRUE(tracked.fix) << i;
    EXPECT_LT(Distance(tracked.fix->T_camera_world, T_world_camera.Inverse()), 1e-4) << i;
    EXPECT_EQ(tracker_.last().frames_since_keyframe, i);
    EXPECT_DOUBLE_EQ(tracker_.last().frame.stamp_s, 0.1 * i);
    ASSERT_TRUE(tracker_.last().velocity);
    EXPECT_NEAR(tracker_.last().velocity->x(), -0.5, 0.01);
    EXPECT_NEAR(tracker_.last().velocity->z(), -1, 0.01);
  }
}

TEST_F(TrackerTest, AMotionIsSteadyOnceItHasLedToTheNextFrame) {
  Tracker stereo{OdometryOptions(), Rig(Sensor::kStereo)};
  stereo.Begin({0, 0, map_.keyframe(0).features}, std::as_const(map_).keyframe(0));
  const auto goes_to = [&](double z, double stamp_s) {
    return stereo.Track(Frame(Moved(0, z), stamp_s), map_).fix.has_value();
  };
  ASSERT_TRUE(goes_to(0.1, 0.1));
  EXPECT_FALSE(stereo.last().steady) << "the first step tells how fast it is";
  ASSERT_TRUE(goes_to(0.2, 0.2));
  EXPECT_TRUE(stereo.last().steady);
  ASSERT_TRUE(goes_to(1.2, 0.3)) << "nearly all landmarks say so";
  EXPECT_FALSE(stereo.last().steady);
}

TEST_F(TrackerTest, OneCameraIsSteadyByTheShareOfItsWay) {
  const auto goes_to = [&](double z, double stamp_s) {
    return Track(Frame(Moved(0, z), stamp_s)).fix.has_value() && tracker_.last().steady;
  };
  EXPECT_FALSE(goes_to(0.1, 0.1));
  EXPECT_TRUE(goes_to(0.2, 0.2));
  EXPECT_TRUE(goes_to(0.33, 0.3)) << "a third more";
  EXPECT_FALSE(goes_to(1.33, 0.4)) << "eight times as much";
}

TEST_F(TrackerTest, ALostFrameKeepsThePlaceAndTheNextIsFoundThere) {
  Track(Frame(Moved(0.1, 0), 0.1));
  const Pose before = tracker_.last().T_camera_world;
  for (const TrackedFrame& bad : {Elsewhere(0.2), Nothing(0.3)}) {
    const Tracker::Tracked tracked = Track(bad);
    EXPECT_FALSE(tracked.fix);
    EXPECT_EQ(tracked.need, KeyframeNeed::kNone);
    EXPECT_EQ(tracker_.state(), TrackingState::kLost);
    EXPECT_EQ(tracker_.last().T_camera_world.Matrix(), before.Matrix());
  }
  ASSERT_TRUE(Track(Frame(Moved(0.2, 0), 0.4)).fix);
  EXPECT_EQ(tracker_.state(), TrackingState::kTracking);
  EXPECT_FALSE(tracker_.last().velocity) << "what happened in between is not known";
}

TEST_F(TrackerTest, StampsThatDoNotGrowTellNoVelocity) {
  for (const double stamp_s : {std::numeric_limits<double>::quiet_NaN(), 0.0, -5.0, 1e9}) {
    Tracker tracker = tracker_;
    TrackedFrame frame = Frame(Moved(0.1, 0), 0.1);
    frame.stamp_s = stamp_s;
    ASSERT_TRUE(tracker.Track(frame, map_).fix) << stamp_s;
    EXPECT_FALSE(tracker.last().velocity) << stamp_s;
    EXPECT_TRUE(tracker.Track(Frame(Moved(0.2, 0), 0.2), map_).fix) << "and the next one, after " << stamp_s;
  }
}

TEST_F(TrackerTest, AFrameThatBecameAKeyframeIsItsOwnReference) {
  ASSERT_TRUE(Track(Frame(Moved(0.6, 0), 0.1)).fix);
  std::vector<int> order;
  const int id = AddKeyframe(Moved(0.6, 0), &order);
  tracker_.BecomeKeyframe(std::as_const(map_).keyframe(id));
  EXPECT_EQ(tracker_.last().reference, id);
  EXPECT_EQ(tracker_.last().newest_keyframe, id);
  EXPECT_EQ(tracker_.last().frames_since_keyframe, 0);
  EXPECT_EQ(tracker_.last().matches.landmarks, std::as_const(map_).keyframe(id).landmarks);
}

TEST_F(TrackerTest, AsksForAKeyframeWhereFewLandmarksAreLeft) {
  OdometryOptions options;
  options.min_inliers = static_cast<int>(order_.size()) / 3 + 1;  // three times as many are very weak
  Tracker tracker(options, Rig());
  tracker.Begin({0, 0, map_.keyframe(0).features}, std::as_const(map_).keyframe(0));
  EXPECT_EQ(tracker.Track(Frame(Moved(0, 0, 0.05), 0.1), map_).need, KeyframeNeed::kVeryWeak);
  EXPECT_EQ(Track(Frame(Moved(0, 0, 0.05), 0.1)).need, KeyframeNeed::kNone);
}

TEST_F(TrackerTest, TheLastFrameMovesAndGrowsWithItsReference) {
  Track(Frame(Moved(0.1, 0), 0.1));
  tracker_.FollowReference(Pose(), Similarity(2, ExpSO3({0, 0, 0}), {5, 0, 0}));
  const Pose T_world_camera = tracker_.last().T_camera_world.Inverse();
  EXPECT_LT((T_world_camera.translation - Eigen::Vector3d(5.2, 0, 0)).norm(), 1e-4);
  ASSERT_TRUE(tracker_.last().velocity);
  EXPECT_NEAR(tracker_.last().velocity->x(), -2, 1e-3);
}

TEST_F(TrackerTest, MergedLandmarksAreSeenOnceAndDeadOnesNotAtAll) {
  Track(Frame(Pose(), 0.1));
  const std::vector<int> before = tracker_.last().matches.landmarks;
  ASSERT_EQ(before[3], 3);
  map_.ReplaceLandmark(4, 3);
  map_.RemoveLandmark(7);
  tracker_.FollowLandmarks(map_);
  const std::vector<int>& after = tracker_.last().matches.landmarks;
  EXPECT_EQ(after[3], 3);
  EXPECT_EQ(after[4], -1);
  EXPECT_EQ(after[7], -1);
  EXPECT_EQ(after[8], 8);
}

TEST_F(TrackerTest, OfAKeyframeTheLastFrameHasWhatTheMapGivesIt) {
  map_.RemoveObservation(5, 0);
  tracker_.FollowLandmarks(map_);
  EXPECT_EQ(tracker_.last().matches.landmarks, std::as_const(map_).keyframe(0).landmarks);
}

TEST_F(TrackerTest, GivingUpKeepsThePlaceAndForAShortWhileTheMotion) {
  const auto begun_after = [&](Sensor sensor, double seconds) {
    Tracker tracker(OdometryOptions(), Rig(sensor));
    tracker.Begin({0, 0, map_.keyframe(0).features}, std::as_const(map_).keyframe(0));
    tracker.Track(Frame(Moved(0.1, 0), 0.1), map_);
    tracker.GiveUp();
    EXPECT_EQ(tracker.state(), TrackingState::kInitializing);
    EXPECT_LT(Distance(tracker.last().T_camera_world, Moved(0.1, 0).Inverse()), 1e-4);
    const double stamp_s = 0.1 + seconds;
    tracker.Begin({9, stamp_s, map_.keyframe(0).features}, std::as_const(map_).keyframe(0));
    EXPECT_FALSE(tracker.last().steady);
    return tracker.last().velocity;
  };
  const auto velocity = begun_after(Sensor::kStereo, 1);
  ASSERT_TRUE(velocity);
  EXPECT_NEAR(velocity->x(), -1, 0.01);
  EXPECT_FALSE(begun_after(Sensor::kStereo, 2));
  EXPECT_FALSE(begun_after(Sensor::kStereo, -1)) << "the clock was set back";
  EXPECT_FALSE(begun_after(Sensor::kStereo, std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(begun_after(Sensor::kMono, 1)) << "another piece has another unit";
}

TEST_F(TrackerTest, RelocalisedItTracksAgainWithoutAVelocity) {
  Track(Elsewhere(0.1));
  const TrackedFrame frame = Frame(Moved(0.3, 0, 0.4), 0.2);
  const auto fix = PoseSearch(OdometryOptions(), Rig()).FindAt(map_, frame, 0);
  ASSERT_TRUE(fix);
  tracker_.GiveUp();
  EXPECT_TRUE(tracker_.Relocalize(0, *fix, map_).fix);
  EXPECT_EQ(tracker_.state(), TrackingState::kTracking);
  EXPECT_EQ(tracker_.last().newest_keyframe, 0);
  EXPECT_FALSE(tracker_.last().velocity);
  EXPECT_LT(Distance(tracker_.last().T_camera_world, Moved(0.3, 0, 0.4).Inverse()), 1e-4);
}

}  // namespace
}  // namespace tutti
