#include "frontend/map/fuse.h"

#include <gtest/gtest.h>

#include "tests/frontend/map/point_scene.h"

namespace tutti {
namespace {

// Four keyframes that see the same points: the first two with one set of landmarks, the last two, which
// drifted by `drift`, with another.
class LandmarkFusion : public ::testing::Test, protected testing::PointScene {
 protected:
  void SeenTwice(const Pose& drift) {
    for (int half = 0; half < 2; ++half) {
      const Pose off = half == 0 ? Pose() : drift;
      int landmarks[kPoints];
      std::fill(std::begin(landmarks), std::end(landmarks), -1);
      for (const double x : {0.0, 0.3}) {
        const Pose truth(Eigen::Quaterniond::Identity(), {x + 0.1 * half, 0, 0});
        std::vector<int> order;
        const int id = AddKeyframe(truth, &order);
        map_.keyframe(id).T_world_camera = off * truth;
        for (std::size_t f = 0; f < order.size(); ++f) {
          int& l = landmarks[order[f]];
          if (l < 0)
            l = map_.AddLandmark(off * points_[static_cast<std::size_t>(order[f])], id, static_cast<int>(f));
          else
            map_.AddObservation(l, id, static_cast<int>(f));
          map_.UpdateLandmark(l);
        }
      }
    }
  }

  int Alive() const {
    int alive = 0;
    for (int l = 0; l < map_.LandmarkCount(); ++l) alive += map_.landmark(l).alive ? 1 : 0;
    return alive;
  }

  const Pose drift_{ExpSO3({0, 0.02, 0}), {0.4, 0.1, -0.2}};
  const Pose T_first_third_{Eigen::Quaterniond::Identity(), {0.1, 0, 0}};
};

TEST_F(LandmarkFusion, ALoopMakesWhatBothEndsSeeOne) {
  SeenTwice(drift_);
  const int before = Alive();
  EXPECT_GT(FuseLoop(camera_, 0, 2, T_first_third_, &map_), 240);
  EXPECT_LT(Alive(), 0.6 * before);
  EXPECT_GT(map_.keyframe(0).covisible.at(3), 200);
  for (int l = 0; l < map_.LandmarkCount();
       ++l) {  // every descriptor has one point: nothing wrong was merged
    const Landmark& landmark = map_.landmark(l);
    for (const Observation& o : landmark.observations)
      EXPECT_EQ(HammingDistance(map_.keyframe(o.keyframe).features->Descriptor(o.feature),
                                landmark.descriptor.data()),
                0);
  }
}

TEST_F(LandmarkFusion, WhereTheLoopIsWrongNothingIsInCommon) {
  SeenTwice(drift_);
  const int before = Alive();
  const Pose wrong(ExpSO3({0, 0.2, 0.1}), {1, 0, 0});
  EXPECT_LT(FuseLoop(camera_, 0, 2, wrong, &map_), 10);
  EXPECT_GT(Alive(), 0.97 * before);
}

TEST_F(LandmarkFusion, AFusedLoopIsFusedAlready) {
  SeenTwice(drift_);
  const int first = FuseLoop(camera_, 0, 2, T_first_third_, &map_);
  const int alive = Alive();
  EXPECT_GE(FuseLoop(camera_, 0, 2, T_first_third_, &map_), first);
  EXPECT_EQ(Alive(), alive);
}

TEST_F(LandmarkFusion, ALandmarkOfAMapThatStaysWinsAgainstOneWithMoreViews) {
  SeenTwice(Pose());
  const int old = map_.keyframe(0).landmarks[0], recent = map_.keyframe(2).landmarks[0];
  ASSERT_NE(old, recent);
  map_.RemoveObservation(old, 1);
  ASSERT_LT(map_.landmark(old).observations.size(), map_.landmark(recent).observations.size());
  Map grows = map_;
  FuseInto(2, {{old, 0}}, &grows);
  EXPECT_EQ(grows.Present(old), recent);
  FuseInto(2, {{old, 0}}, &map_, old + 1);
  EXPECT_EQ(map_.Present(recent), old);
}

TEST_F(LandmarkFusion, MergedLandmarksLeadToTheOneThatStays) {
  SeenTwice(drift_);
  FuseLoop(camera_, 0, 2, T_first_third_, &map_);
  for (int l = 0; l < map_.LandmarkCount(); ++l) {
    ASSERT_GE(map_.Present(l), 0);
    EXPECT_TRUE(map_.landmark(map_.Present(l)).alive);
  }
  EXPECT_EQ(map_.Present(-1), -1);
}

}  // namespace
}  // namespace tutti
