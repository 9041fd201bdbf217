#include "frontend/odometry/async_mapper.h"

#include <gtest/gtest.h>

#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

using testing::Moved;

class AsyncMapperTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  AsyncMapper Make(Sensor sensor = Sensor::kRgbd, int delay_frames = 1) const {
    OdometryOptions options;
    options.mapping_delay_frames = delay_frames;
    return AsyncMapper(options, Rig(sensor));
  }
  // A keyframe at a place that is `off` the true one, seeing what the first keyframe has made of it.
  int Add(AsyncMapper* mapper, double x, double off = 0) const {
    const TrackedFrame frame = Frame(Moved(x, 0), x, true);
    FrameMatches matches{frame.features.get(), std::vector<int>(frame.features->size(), -1)};
    if (mapper->map().KeyframeCount() > 0)
      MatchToKeyframe(mapper->map(), mapper->map().keyframe(0), &matches);
    return mapper->AddKeyframe(frame, 0, Moved(x + off, 0), matches.landmarks);
  }
  // Two keyframes, the second to be mapped; it stands wrong by 2 cm.
  AsyncMapper Started(bool own_threads, int delay_frames = 1) const {
    AsyncMapper mapper = Make(Sensor::kRgbd, delay_frames);
    mapper.UseOwnThreads(own_threads);
    Add(&mapper, 0);
    mapper.Start(Add(&mapper, 0.3, 0.02), stages_);
    return mapper;
  }
  static double Place(const AsyncMapper& mapper) {
    return mapper.map().keyframe(1).T_world_camera.translation.x();
  }
  StageTimes stages_;
};

TEST_F(AsyncMapperTest, AKeyframeGetsLandmarksFromItsDepth) {
  AsyncMapper mapper = Make();
  const TrackedFrame frame = Frame(Pose(), 0, true);
  EXPECT_EQ(mapper.AddKeyframe(frame, 3, Moved(1, 0), {}), 0);
  const Keyframe& k = mapper.map().keyframe(0);
  EXPECT_EQ(k.piece, 3);
  EXPECT_EQ(mapper.map().LandmarkCount(), static_cast<int>(frame.features->size()));
  const Eigen::Vector3d expected = Moved(1, 0) * points_[static_cast<std::size_t>(order_[5])];
  EXPECT_LT((mapper.map().landmark(k.landmarks[5]).position - expected).norm(), 1e-5);
}

TEST_F(AsyncMapperTest, WithoutDepthAKeyframeSeesWhatItsFrameSawAndLives) {
  AsyncMapper mapper = Make(Sensor::kMono);
  mapper.AddKeyframe(Frame(Pose(), 0), 0, Pose(), {});
  EXPECT_EQ(mapper.map().LandmarkCount(), 0);
  mapper.MutableMap()->AddLandmark({0, 0, 5}, 0, 0);
  mapper.MutableMap()->AddLandmark({1, 0, 5}, 0, 1);
  mapper.MutableMap()->RemoveLandmark(1);
  const int id = mapper.AddKeyframe(Frame(Pose(), 1), 0, Pose(), {0, 1, -1});
  EXPECT_EQ(mapper.map().keyframe(id).landmarks[0], 0);
  EXPECT_EQ(mapper.map().keyframe(id).landmarks[1], -1);
  EXPECT_EQ(mapper.map().landmark(0).observations.size(), 2U);
}

TEST_F(AsyncMapperTest, TheResultIsDueAfterTheDelayAndEntersThen) {
  for (const bool own_threads : {true, false}) {
    AsyncMapper mapper = Started(own_threads, 2);
    EXPECT_TRUE(mapper.Busy());
    mapper.NextFrame();
    EXPECT_FALSE(mapper.Due());
    mapper.NextFrame();
    EXPECT_TRUE(mapper.Due());
    EXPECT_DOUBLE_EQ(Place(mapper), 0.32) << "as it is until then";
    EXPECT_TRUE(mapper.TakeMapped().empty());
    mapper.Enter(&stages_);
    EXPECT_NEAR(Place(mapper), 0.3, 0.002) << "adjusted";
    EXPECT_FALSE(mapper.Busy());
    EXPECT_FALSE(mapper.Due());
    EXPECT_EQ(mapper.TakeMapped(), std::vector<int>{1});
    EXPECT_TRUE(mapper.TakeMapped().empty());
    EXPECT_GT(stages_.milliseconds.at("map"), 0);
  }
}

TEST_F(AsyncMapperTest, WithoutADelayItIsDueAtOnce) { EXPECT_TRUE(Started(false, 0).Due()); }

TEST_F(AsyncMapperTest, ThreadsChangeNothing) {
  std::vector<AsyncMapper> both{Started(true), Started(false)};
  for (AsyncMapper& mapper : both) mapper.Enter(&stages_);
  const Map &a = both[0].map(), &b = both[1].map();
  EXPECT_EQ(a.keyframe(1).T_world_camera.Matrix(), b.keyframe(1).T_world_camera.Matrix());
  ASSERT_EQ(a.LandmarkCount(), b.LandmarkCount());
  for (int l = 0; l < a.LandmarkCount(); ++l) EXPECT_EQ(a.landmark(l).position, b.landmark(l).position) << l;
}

TEST_F(AsyncMapperTest, ACopyGoesOnWithTheSameWork) {
  AsyncMapper mapper = Started(true);
  AsyncMapper copy = mapper;
  mapper.Enter(&stages_);
  EXPECT_TRUE(copy.Busy());
  EXPECT_DOUBLE_EQ(Place(copy), 0.32);
  copy.Enter(&stages_);
  EXPECT_EQ(Place(copy), Place(mapper));
  EXPECT_EQ(copy.TakeMapped(), std::vector<int>{1});
}

TEST_F(AsyncMapperTest, WhatFramesSawMeanwhileIsCountedWhenTheResultEnters) {
  AsyncMapper mapper = Started(true);
  PoseFix fix(Frame(Pose(), 0));
  fix.visible = {2, 6};
  fix.found = {-1, 6};
  const int visible = mapper.map().landmark(2).visible, found = mapper.map().landmark(2).found;
  mapper.CountSeen(fix);
  EXPECT_EQ(mapper.map().landmark(2).visible, visible) << "the map is not written to";
  mapper.Enter(&stages_);
  EXPECT_EQ(mapper.map().landmark(2).visible, visible + 1);
  EXPECT_EQ(mapper.map().landmark(2).found, found);
  EXPECT_EQ(mapper.map().landmark(6).found, found + 1);
  mapper.CountSeen(fix);
  EXPECT_EQ(mapper.map().landmark(2).visible, visible + 2) << "nothing is under way";
}

TEST_F(AsyncMapperTest, ALandmarkThatWasMergedCountsForTheOneThatIsLeft) {
  AsyncMapper mapper = Make();
  Add(&mapper, 0);
  mapper.MutableMap()->ReplaceLandmark(4, 3);
  mapper.MutableMap()->RemoveLandmark(5);
  const int visible = mapper.map().landmark(3).visible;
  PoseFix fix(Frame(Pose(), 0));
  fix.visible = {4, 5};
  mapper.CountSeen(fix);
  EXPECT_EQ(mapper.map().landmark(3).visible, visible + 1);
}

TEST_F(AsyncMapperTest, AKeyframeWithoutFeaturesIsMappedToNothing) {
  for (const Sensor sensor : {Sensor::kMono, Sensor::kStereo, Sensor::kRgbd}) {
    AsyncMapper mapper = Make(sensor);
    mapper.Start(mapper.AddKeyframe(Nothing(0), 0, Pose(), {}), stages_);
    mapper.Enter(&stages_);
    EXPECT_EQ(mapper.map().LandmarkCount(), 0);
    EXPECT_EQ(mapper.TakeMapped(), std::vector<int>{0});
  }
}

TEST_F(AsyncMapperTest, ASkippedKeyframeIsMappedInItsTurn) {
  AsyncMapper mapper = Make();
  mapper.Skip(Add(&mapper, 0));
  mapper.Start(Add(&mapper, 0.1), stages_);
  mapper.Enter(&stages_);
  EXPECT_EQ(mapper.TakeMapped(), (std::vector<int>{0, 1}));
}

}  // namespace
}  // namespace tutti
