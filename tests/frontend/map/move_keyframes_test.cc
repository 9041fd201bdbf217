// What loops do to the odometry's map: fusion, and bundle adjustment of everything.
#include "frontend/map/move_keyframes.h"

#include <gtest/gtest.h>

#include "frontend/features/features.h"
#include "tests/support/recording.h"
#include "tests/support/rendered_world.h"
#include "tests/support/small_town.h"

namespace tutti {
namespace {

using testing::Recording;

const Recording& Drive() {
  static const Recording recording =
      testing::Record(testing::RenderedWorld(testing::SmallStereoTown(400, 200)), 40);
  return recording;
}

Odometry Tracked(std::size_t frames, bool own_threads = true) {
  Odometry odometry(OdometryOptions(), Drive().rig, {own_threads, nullptr});
  for (std::size_t i = 0; i < frames; ++i) odometry.Track(Drive().frames[i]);
  odometry.FinishMapping();
  return odometry;
}

// Bends the map, more and more to its end, as a wrong loop would.
void Bend(Odometry& odometry) {
  std::map<int, Similarity> bent;
  for (const int id : odometry.map().KeyframeIds()) {
    const double way = 0.05 * id;
    bent[id] = Similarity(Pose(ExpSO3({0, 0.1 * way, 0}), {way, 0.3 * way, 0}) *
                          odometry.map().keyframe(id).T_world_camera);
  }
  odometry.Correct({bent, {}, {}, {}});
}

double WorstError(const Odometry& odometry) {
  double worst = 0;
  const Trajectory estimate = FrameTrajectory(odometry.map());
  const Pose to_estimate = estimate.front().pose * Drive().truth.front().pose.Inverse();
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    const Pose truth = to_estimate * Drive().truth[i].pose;
    worst = std::max(worst, (estimate[i].pose.translation - truth.translation).norm());
  }
  return worst;
}

bool Adjust(Odometry& odometry, const GlobalAdjustment& adjustment) {
  const auto moved = adjustment.Correction(odometry.map());
  if (moved) odometry.Correct({*moved, {}, std::make_shared<const GlobalAdjustment>(adjustment), {}});
  return moved.has_value();
}

TEST(MapCorrection, GlobalAdjustmentTakesABentMapBackToWhatTheImagesSay) {
  Odometry odometry = Tracked(40);
  const double before = WorstError(odometry);
  Bend(odometry);
  const double bent = WorstError(odometry);
  ASSERT_GT(bent, 3 * before);
  ASSERT_TRUE(Adjust(odometry, AdjustGlobally(odometry, 0)));
  EXPECT_LT(WorstError(odometry), 0.3 * bent);
  EXPECT_LT(WorstError(odometry), 2 * before + 0.01);
}

TEST(MapCorrection, KeyframesThatCameSinceFollow) {
  Odometry odometry = Tracked(25);
  Bend(odometry);
  const GlobalAdjustment adjustment = AdjustGlobally(odometry, 0);
  for (std::size_t i = 25; i < 40; ++i) odometry.Track(Drive().frames[i]);
  odometry.FinishMapping();
  const double bent = WorstError(odometry);
  ASSERT_LT(adjustment.Keyframes() + 1, static_cast<int>(odometry.map().KeyframeIds().size()));
  ASSERT_TRUE(Adjust(odometry, adjustment));
  EXPECT_LT(WorstError(odometry), 0.6 * bent);
  EXPECT_EQ(FrameTrajectory(odometry.map()).size(), 40U);
}

TEST(MapCorrection, LeavesNoStepBetweenFrames) {
  Odometry odometry = Tracked(40);
  const Trajectory before = FrameTrajectory(odometry.map());
  const std::vector<int> ids = odometry.map().KeyframeIds();
  const std::size_t half = ids.size() / 2;  // the rest is elsewhere, as where a loop's query is
  const Pose aside(Eigen::Quaterniond::Identity(), {0.4, 0, 0});
  std::map<int, Similarity> moved;
  for (std::size_t k = half; k < ids.size(); ++k)
    moved[ids[k]] = Similarity(aside * odometry.map().keyframe(ids[k]).T_world_camera);
  odometry.Correct({moved, {}, {}, {}});
  const Trajectory after = FrameTrajectory(odometry.map());
  const auto shift = [&](std::size_t i) {
    return Eigen::Vector3d(after[i].pose.translation - before[i].pose.translation);
  };
  double largest = 0;
  for (std::size_t i = 1; i < after.size(); ++i)
    largest = std::max(largest, (shift(i) - shift(i - 1)).norm());
  const auto frames =
      odometry.map().keyframe(ids[half]).frame_index - odometry.map().keyframe(ids[half - 1]).frame_index;
  std::printf("  %.3f m in one of %d steps\n", largest, static_cast<int>(frames));
  ASSERT_GE(frames, 2);
  EXPECT_LT(largest, 1.2 * 0.4 / static_cast<double>(frames));
  EXPECT_LT(shift(0).norm(), 1e-9);
  EXPECT_NEAR(shift(after.size() - 1).x(), 0.4, 1e-9);
}

TEST(MapCorrection, TheResultIsTheSameWithAndWithoutThreads) {
  std::vector<Trajectory> results;
  for (const bool own_threads : {true, false}) {
    Odometry odometry = Tracked(25, own_threads);
    Bend(odometry);
    const GlobalAdjustment adjustment = AdjustGlobally(odometry, 0);
    for (std::size_t i = 25; i < 32; ++i) odometry.Track(Drive().frames[i]);
    ASSERT_TRUE(Adjust(odometry, adjustment));
    for (std::size_t i = 32; i < 40; ++i) odometry.Track(Drive().frames[i]);
    odometry.FinishMapping();
    results.push_back(FrameTrajectory(odometry.map()));
  }
  ASSERT_EQ(results[0].size(), results[1].size());
  for (std::size_t i = 0; i < results[0].size(); ++i)
    EXPECT_EQ(results[0][i].pose.Matrix(), results[1][i].pose.Matrix()) << i;
}

TEST(MapCorrection, ACancelledAdjustmentChangesNothing) {
  Odometry odometry = Tracked(25);
  Bend(odometry);
  const Trajectory before = FrameTrajectory(odometry.map());
  {
    GlobalAdjustment adjustment = AdjustGlobally(odometry, 0);
    adjustment.Cancel();
  }
  const Trajectory after = FrameTrajectory(odometry.map());
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(before[i].pose.Matrix(), after[i].pose.Matrix());
}

TEST(MapCorrection, AMapOfOneKeyframeHasNothingToAdjust) {
  Odometry odometry = Tracked(1);
  EXPECT_FALSE(Adjust(odometry, AdjustGlobally(odometry, 0)));
  EXPECT_FALSE(Adjust(odometry, AdjustGlobally(odometry, 7))) << "no such piece";
}

TEST(MapCorrection, NeighboursShareWhatTheySee) {
  Odometry odometry = Tracked(40);
  const std::vector<int> ids = odometry.map().KeyframeIds();
  const int a = ids[ids.size() - 2], b = ids.back();
  const Similarity S(odometry.map().keyframe(a).T_world_camera.Inverse() *
                     odometry.map().keyframe(b).T_world_camera);
  EXPECT_GT(odometry.Correct({{}, {}, {}, {{a, b, S}}}).at(0), 100);
}

std::vector<int> PiecesAfter(const std::map<int, int>& joined) {
  Map map(PyramidScales(OdometryOptions()));
  for (int piece = 0; piece < 4; ++piece) {
    tutti::Keyframe k;
    k.piece = piece;
    k.features = std::make_shared<FrameFeatures>();
    map.AddKeyframe(k);
  }
  JoinPieces(joined, &map);
  std::vector<int> pieces;
  pieces.reserve(4);
  for (int id = 0; id < 4; ++id) pieces.push_back(std::as_const(map).keyframe(id).piece);
  return pieces;
}

TEST(JoinPieces, FollowsAPieceToTheOneThatItEndsIn) {
  EXPECT_EQ(PiecesAfter({}), (std::vector<int>{0, 1, 2, 3}));
  EXPECT_EQ(PiecesAfter({{2, 1}, {1, 0}}), (std::vector<int>{0, 0, 0, 3}));
  EXPECT_EQ(PiecesAfter({{3, 3}, {7, 0}}), (std::vector<int>{0, 1, 2, 3})) << "itself; one that is not there";
}

TEST(JoinPieces, EndsWherePiecesJoinInACircle) {
  const std::vector<int> pieces = PiecesAfter({{1, 2}, {2, 1}});
  EXPECT_EQ(pieces[0], 0);
  EXPECT_EQ(pieces[3], 3);
}

}  // namespace
}  // namespace tutti
