#include "frontend/map/map_frames.h"

#include <gtest/gtest.h>

#include <utility>

#include "frontend/map/move_keyframes.h"
#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

using testing::Distance;
using testing::Moved;

// Keyframes 0, 1 (at x = 1) and 2 (at x = 2, of piece 1).
class MapFramesTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  MapFramesTest() {
    std::vector<int> order;
    AddKeyframe(Moved(1, 0), &order);
    map_.keyframe(AddKeyframe(Moved(2, 0), &order)).piece = 1;
  }
  // Keyframe 1 was frame 5 of a camera that went straight on from keyframe 0, where it had begun.
  void GoOn() {
    map_.keyframe(1).frame_index = 5;
    for (int i = 0; i <= 6; ++i) map_.AddFrame(i, 0.1 * i, i < 5 ? 0 : 1, Moved(0.2 * i, 0).Inverse());
  }
  void Add(double stamp_s, double x, int reference) {
    map_.AddFrame(static_cast<std::int64_t>(10 * stamp_s), stamp_s, reference, Moved(x, 0.5, 0.1).Inverse());
  }
};

TEST_F(MapFramesTest, NoFramesHaveNoPosesAndNoPieces) {
  EXPECT_TRUE(FramePieces(map_).empty());
  for (const int piece : {-1, 0, 7}) {
    EXPECT_TRUE(FrameTrajectory(map_, piece).empty());
    EXPECT_TRUE(FrameIndices(map_, piece).empty());
  }
  RescaleFrames({{0, Similarity(2, ExpSO3({0, 0, 0}), {0, 0, 0})}}, &map_);
  EXPECT_TRUE(FrameTrajectory(Map(PyramidScales(OdometryOptions())), -1).empty()) << "nor in an empty map";
}

TEST_F(MapFramesTest, TellsPosesAndIndicesOfFrames) {
  Add(0.1, 0.2, 0);
  Add(0.2, 0.9, 1);
  const Trajectory poses = FrameTrajectory(map_, 0);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_DOUBLE_EQ(poses[1].stamp_s, 0.2);
  EXPECT_LT(Distance(poses[0].pose, Moved(0.2, 0.5, 0.1)), 1e-9);
  EXPECT_LT(Distance(poses[1].pose, Moved(0.9, 0.5, 0.1)), 1e-9);
  EXPECT_EQ(FrameIndices(map_, 0), (std::vector<std::int64_t>{1, 2}));
}

TEST_F(MapFramesTest, ADriftIsSpreadOverTheNewestFrames) {
  Add(0.1, 0.2, 0);
  Add(0.2, 0.4, 0);
  Add(0.3, 0.6, 0);
  // The frame that comes next stands 0.3 m farther along the world's x than it would have by the others.
  const Pose before = Moved(0.8, 0.5, 0.1);
  Pose after = before;
  after.translation.x() += 0.3;
  const Vector6d drift = LogSE3(after.Inverse() * before);
  SpreadDrift(2, drift, after.Inverse().rotation, &map_);
  const Trajectory poses = FrameTrajectory(map_, 0);
  EXPECT_LT(Distance(poses[0].pose, Moved(0.2, 0.5, 0.1)), 1e-9);
  EXPECT_LT(Distance(poses[1].pose, Moved(0.5, 0.5, 0.1)), 1e-9);
  EXPECT_LT(Distance(poses[2].pose, Moved(0.8, 0.5, 0.1)), 1e-9);
}

TEST_F(MapFramesTest, FramesFollowTheirKeyframesWithTheirScale) {
  Add(0.1, 0.2, 0);
  Add(0.2, 1.3, 1);
  MoveKeyframes({{1, Similarity(2, ExpSO3({0, 0, 0}), {5, 0, 0})}}, &map_);
  const Trajectory poses = FrameTrajectory(map_, 0);
  EXPECT_LT(Distance(poses[0].pose, Moved(0.2, 0.5, 0.1)), 1e-9) << "its keyframe stays";
  EXPECT_LT((poses[1].pose.translation - Eigen::Vector3d(5.6, 0, 1)).norm(), 1e-9);
}

TEST_F(MapFramesTest, FramesBetweenTwoKeyframesFollowBoth) {
  GoOn();
  const Pose shift(ExpSO3({0, 0.1, 0}), {0, 0.3, 0});
  const Pose corrected = shift * Moved(1, 0);
  MoveKeyframes({{1, Similarity(corrected)}}, &map_);
  const Trajectory poses = FrameTrajectory(map_, 0);
  EXPECT_EQ(poses[0].pose.Matrix(), Pose().Matrix());
  EXPECT_EQ(poses[5].pose.Matrix(), corrected.Matrix());
  EXPECT_LT(Distance(poses[6].pose, shift * Moved(1.2, 0)), 1e-9);
  for (int i = 1; i < 5; ++i) {
    const Pose &pose = poses[static_cast<std::size_t>(i)].pose, by_last = Moved(0.2 * i, 0);
    const Eigen::Vector3d by_next = shift * by_last.translation;
    EXPECT_LT((pose.translation - (by_last.translation + 0.2 * i * (by_next - by_last.translation))).norm(),
              1e-9);
    EXPECT_NEAR(LogSO3(pose.rotation).y(), 0.02 * i, 1e-9);
  }
}

TEST_F(MapFramesTest, TheScaleOfFramesBetweenTwoKeyframesIsThatOfBoth) {
  GoOn();
  MoveKeyframes({{1, Similarity(2, ExpSO3({0, 0, 0}), {2, 0, 0})}}, &map_);
  const Trajectory poses = FrameTrajectory(map_, 0);
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_LT((poses[i].pose.translation - Eigen::Vector3d(0.4 * double(i), 0, 0)).norm(), 1e-9) << i;
}

TEST_F(MapFramesTest, HalfWayBetweenTwoChangesFramesFollowTheirKeyframeAlone) {
  for (int i = 0; i < 9; ++i)
    map_.AddFrame(10 + i, 0.1 * i, i < 3 || i > 5 ? 0 : 1, Moved(0.2 * i, 0).Inverse());
  MoveKeyframes({{1, Similarity(Moved(1, 0.3))}}, &map_);
  const Trajectory poses = FrameTrajectory(map_, 0);
  const double z[] = {0, 0, 0.1, 0.2, 0.3, 0.2, 0.1, 0, 0};
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_LT(Distance(poses[i].pose, Moved(0.2 * double(i), z[i])), 1e-9) << i;
}

TEST_F(MapFramesTest, WhatATornMapSaidOfAFrameIsForgottenWhenItIsMended) {
  map_.keyframe(1).T_world_camera = Moved(1, 0.5);
  for (int i = 0; i < 7; ++i)
    map_.AddFrame(10 + i, 0.1 * i, i < 5 ? 0 : 1, Moved(0.2 * i, i < 5 ? 0 : 0.5).Inverse());
  MoveKeyframes({{1, Similarity(Moved(1, 0))}}, &map_);
  const Trajectory poses = FrameTrajectory(map_, 0);
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_LT(Distance(poses[i].pose, Moved(0.2 * double(i), 0)), 1e-9) << i;
}

TEST_F(MapFramesTest, FramesDoNotFollowWhatTheCameraWasNotTrackedFromNorWhatHasTheSameTime) {
  for (const bool goes_on : {false, true}) {
    for (int i = 0; i < 4; ++i)
      map_.AddFrame(10 + i, goes_on ? 1 : 0.1 * i, i < 2 ? 0 : 1, Moved(0.2 * i, 0).Inverse(),
                    i > 0 && (goes_on || i != 2));
  }
  map_.AddFrame(20, 2, 2, Moved(1, 0).Inverse());  // another submap
  EXPECT_EQ(std::as_const(map_).frames()[8].before, -1);
  MoveKeyframes({{1, Similarity(Moved(1, 0.3))}}, &map_);
  const Trajectory poses = FrameTrajectory(map_, 0);
  for (std::size_t i = 0; i < poses.size(); ++i)
    EXPECT_LT(Distance(poses[i].pose, Moved(0.2 * double(i % 4), i % 4 < 2 ? 0 : 0.3)), 1e-9) << i;
}

TEST_F(MapFramesTest, PiecesComeByTheirNumberOfFrames) {
  Add(0.1, 0, 0);
  Add(0.2, 2, 2);
  EXPECT_EQ(FramePieces(map_), (std::vector<int>{0, 1})) << "ties: the older one";
  Add(0.3, 2, 2);
  EXPECT_EQ(FramePieces(map_), (std::vector<int>{1, 0}));
  EXPECT_EQ(FrameIndices(map_, -1), (std::vector<std::int64_t>{2, 3})) << "the one with most frames";
  EXPECT_EQ(FrameIndices(map_, 0), std::vector<std::int64_t>{1});
  EXPECT_TRUE(FrameTrajectory(map_, 2).empty()) << "no such piece";
}

TEST_F(MapFramesTest, FramesOfJoinedPiecesAreOfOne) {
  Add(0.1, 0, 0);
  Add(0.2, 2, 2);
  JoinPieces({{1, 0}}, &map_);
  EXPECT_EQ(FramePieces(map_), std::vector<int>{0});
  EXPECT_EQ(FrameTrajectory(map_, 0).size(), 2U);
}

TEST_F(MapFramesTest, FramesOfARecordingAreARange) {
  Add(0.5, 0, 0);
  Add(0.6, 2, 2);
  map_.AddFrame(1003, 0.3, 1, Pose());
  FrameRange range;
  range.first = 1000;
  EXPECT_EQ(FramePieces(map_, range), std::vector<int>{0});
  EXPECT_EQ(FrameIndices(map_, -1, range), std::vector<std::int64_t>{1003});
  range = {5, 5};
  EXPECT_EQ(FrameIndices(map_, -1, range), std::vector<std::int64_t>{5});
  EXPECT_TRUE(FrameTrajectory(map_, 1, range).empty());
}

TEST_F(MapFramesTest, ACopyGoesOnAlone) {
  Add(0.1, 0, 0);
  const Map copy = map_;
  Add(0.2, 0, 0);
  EXPECT_EQ(FrameTrajectory(copy, 0).size(), 1U);
  EXPECT_EQ(FrameTrajectory(map_, 0).size(), 2U);
}

TEST_F(MapFramesTest, FramesOfRemovedKeyframesStayWhereTheyAreAndFollowWhatStandsForThem) {
  GoOn();
  std::vector<int> order;
  const int third = AddKeyframe(Moved(1.4, 0), &order);
  map_.keyframe(third).frame_index = 7;
  map_.AddFrame(7, 0.7, third, Moved(1.4, 0).Inverse());
  MoveKeyframes({{1, Similarity(Moved(1.1, 0.2, 0.1))}, {third, Similarity(Moved(1.5, 0.1))}}, &map_);
  const Trajectory before = FrameTrajectory(map_, 0);
  const std::vector<Pose> poses = FramePoses(map_);
  map_.RemoveKeyframe(1, 0, 1);
  RehangFrames(poses, &map_);
  Trajectory after = FrameTrajectory(map_, 0);
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_LT(Distance(after[i].pose, before[i].pose), 1e-9) << i;
  EXPECT_EQ(std::as_const(map_).frames()[6].keyframe, 0);
  const Eigen::Vector3d up(0, 0.7, 0);
  const Pose lifted(Pose().rotation, up);
  MoveKeyframes({{third, Similarity(lifted * Moved(1.5, 0.1))}}, &map_);
  after = FrameTrajectory(map_, 0);
  for (std::size_t i = 0; i < before.size(); ++i) {
    const Eigen::Vector3d moved = after[i].pose.translation - before[i].pose.translation;
    EXPECT_LT((moved - static_cast<double>(i) / 7 * up).norm(), 1e-9) << i;
  }
}

}  // namespace
}  // namespace tutti
