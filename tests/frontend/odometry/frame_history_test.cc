#include "frontend/odometry/frame_history.h"

#include <gtest/gtest.h>

#include <limits>

#include "frontend/map/map_correction.h"
#include "tests/frontend/odometry/tracked_scene.h"

namespace tutti {
namespace {

using testing::Distance;
using testing::Moved;

// Keyframes 0, 1 (at x = 1) and 2 (at x = 2, of piece 1).
class FrameHistoryTest : public ::testing::Test, protected testing::TrackedScene {
 protected:
  FrameHistoryTest() {
    std::vector<int> order;
    AddKeyframe(Moved(1, 0), &order);
    map_.keyframe(AddKeyframe(Moved(2, 0), &order)).piece = 1;
  }
  void Add(double stamp_s, double x, int reference) {
    history_.Add({static_cast<std::int64_t>(10 * stamp_s), stamp_s, nullptr}, Moved(x, 0.5, 0.1).Inverse(),
                 std::as_const(map_).keyframe(reference));
  }
  FrameHistory history_;
};

TEST_F(FrameHistoryTest, NoFramesHaveNoPosesAndNoPieces) {
  EXPECT_TRUE(history_.Pieces(map_).empty());
  for (const int piece : {-1, 0, 7}) {
    EXPECT_TRUE(history_.Poses(map_, piece).empty());
    EXPECT_TRUE(history_.Indices(map_, piece).empty());
  }
  history_.Rescale({{0, Similarity(2, ExpSO3({0, 0, 0}), {0, 0, 0})}});
  EXPECT_TRUE(history_.Poses(Map(PyramidScales(OdometryOptions())), -1).empty()) << "nor in an empty map";
}

TEST_F(FrameHistoryTest, TellsPosesAndIndicesOfFrames) {
  Add(0.1, 0.2, 0);
  Add(0.2, 0.9, 1);
  const Trajectory poses = history_.Poses(map_, 0);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_DOUBLE_EQ(poses[1].stamp_s, 0.2);
  EXPECT_LT(Distance(poses[0].pose, Moved(0.2, 0.5, 0.1)), 1e-9);
  EXPECT_LT(Distance(poses[1].pose, Moved(0.9, 0.5, 0.1)), 1e-9);
  EXPECT_EQ(history_.Indices(map_, 0), (std::vector<std::int64_t>{1, 2}));
}

TEST_F(FrameHistoryTest, ADriftIsSpreadOverTheNewestFrames) {
  Add(0.1, 0.2, 0);
  Add(0.2, 0.4, 0);
  Add(0.3, 0.6, 0);
  // The frame that comes next stands 0.3 m farther along the world's x than it would have by the others.
  const Pose before = Moved(0.8, 0.5, 0.1);
  Pose after = before;
  after.translation.x() += 0.3;
  const Vector6d drift = LogSE3(after.Inverse() * before);
  history_.Spread(map_, 2, drift, after.Inverse().rotation);
  const Trajectory poses = history_.Poses(map_, 0);
  EXPECT_LT(Distance(poses[0].pose, Moved(0.2, 0.5, 0.1)), 1e-9);
  EXPECT_LT(Distance(poses[1].pose, Moved(0.5, 0.5, 0.1)), 1e-9);
  EXPECT_LT(Distance(poses[2].pose, Moved(0.8, 0.5, 0.1)), 1e-9);
}

TEST_F(FrameHistoryTest, FramesFollowTheirKeyframesWithTheirScale) {
  Add(0.1, 0.2, 0);
  Add(0.2, 1.3, 1);
  const std::map<int, Similarity> moved{{1, Similarity(2, ExpSO3({0, 0, 0}), {5, 0, 0})}};
  history_.Rescale(moved);
  MoveKeyframes(moved, &map_);
  const Trajectory poses = history_.Poses(map_, 0);
  EXPECT_LT(Distance(poses[0].pose, Moved(0.2, 0.5, 0.1)), 1e-9) << "its keyframe stays";
  EXPECT_LT((poses[1].pose.translation - Eigen::Vector3d(5.6, 0, 1)).norm(), 1e-9);
}

TEST_F(FrameHistoryTest, PiecesComeByTheirNumberOfFrames) {
  Add(0.1, 0, 0);
  Add(0.2, 2, 2);
  EXPECT_EQ(history_.Pieces(map_), (std::vector<int>{0, 1})) << "ties: the older one";
  Add(0.3, 2, 2);
  EXPECT_EQ(history_.Pieces(map_), (std::vector<int>{1, 0}));
  EXPECT_EQ(history_.Indices(map_, -1), (std::vector<std::int64_t>{2, 3})) << "the one with most frames";
  EXPECT_EQ(history_.Indices(map_, 0), std::vector<std::int64_t>{1});
  EXPECT_TRUE(history_.Poses(map_, 2).empty()) << "no such piece";
}

TEST_F(FrameHistoryTest, FramesOfJoinedPiecesAreOfOne) {
  Add(0.1, 0, 0);
  Add(0.2, 2, 2);
  JoinPieces({{1, 0}}, &map_);
  EXPECT_EQ(history_.Pieces(map_), std::vector<int>{0});
  EXPECT_EQ(history_.Poses(map_, 0).size(), 2U);
}

TEST_F(FrameHistoryTest, ARecordingHasItsOwnTimeStampsAndItsFramesAreARange) {
  Add(0.5, 0, 0);
  Add(0.6, 2, 2);
  history_.BeginSession();
  EXPECT_TRUE(history_.IsLater(0.1));
  FrameHistory another;
  another.Add({3, 0.3, nullptr}, Pose(), std::as_const(map_).keyframe(0));
  history_.Append(another, 1000, 1);
  FrameRange range;
  range.first = 1000;
  EXPECT_EQ(history_.Pieces(map_, range), std::vector<int>{0});
  EXPECT_EQ(history_.Indices(map_, -1, range), std::vector<std::int64_t>{1003});
  range = {5, 5};
  EXPECT_EQ(history_.Indices(map_, -1, range), std::vector<std::int64_t>{5});
  EXPECT_TRUE(history_.Poses(map_, 1, range).empty());
}

TEST_F(FrameHistoryTest, KnowsWhatIsLaterThanAllItsFrames) {
  EXPECT_TRUE(history_.IsLater(-7));
  Add(0.2, 0, 0);
  EXPECT_FALSE(history_.IsLater(0.1));
  EXPECT_FALSE(history_.IsLater(0.2));
  EXPECT_TRUE(history_.IsLater(0.3));
  EXPECT_FALSE(history_.IsLater(std::numeric_limits<double>::quiet_NaN()));
}

TEST_F(FrameHistoryTest, ACopyGoesOnAlone) {
  Add(0.1, 0, 0);
  const FrameHistory copy = history_;
  Add(0.2, 0, 0);
  EXPECT_EQ(copy.Poses(map_, 0).size(), 1U);
  EXPECT_EQ(history_.Poses(map_, 0).size(), 2U);
}

TEST_F(FrameHistoryTest, FramesOfRemovedKeyframesStayWhereTheyAreAndFollowWhatStandsForThem) {
  std::vector<int> order;
  const int third = AddKeyframe(Moved(3, 0.2, 0.3), &order);
  Add(0.1, 0.9, 1);
  Add(0.2, 3.1, third);
  history_.Rehang({{1, 0}, {third, 1}}, map_);
  Trajectory poses = history_.Poses(map_, 0);
  ASSERT_EQ(poses.size(), 2U);
  EXPECT_LT(Distance(poses[0].pose, Moved(0.9, 0.5, 0.1)), 1e-9);
  EXPECT_LT(Distance(poses[1].pose, Moved(3.1, 0.5, 0.1)), 1e-9);
  MoveKeyframes({{0, Similarity(Moved(10, 0))}}, &map_);
  poses = history_.Poses(map_, 0);
  EXPECT_LT(Distance(poses[0].pose, Moved(10, 0) * Moved(0.9, 0.5, 0.1)), 1e-9);
  EXPECT_LT(Distance(poses[1].pose, Moved(10, 0) * Moved(3.1, 0.5, 0.1)), 1e-9);
}

}  // namespace
}  // namespace tutti
