// A run's loops against ground truth.
#include "apps/run/run_parts.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti {
namespace {

// One accepted loop from frame 60 back to frame 0, at 30 Hz; the camera is where it was.
RunResult OneLoop() {
  RunResult result;
  result.rig.sensor = Sensor::kRgbd;
  result.frame_interval_s = 1.0 / 30;
  Loop loop;
  loop.query = 60;
  loop.query_stamp_s = 12.0;
  loop.candidate = 0;
  loop.candidate_stamp_s = 10.0;
  loop.state = LoopState::kInMap;
  loop.S_candidate_query = Similarity();
  result.loops = {loop};
  return result;
}

// At rest; a tracking system that began a moment after the camera.
Trajectory TruthFrom(double first_s) {
  Trajectory truth;
  for (double t = first_s; t < 13; t += 0.01) truth.push_back({t, Pose()});
  return truth;
}

RunResult Judged(RunResult result, const Trajectory& truth) {
  EvaluateRun(truth, "truth.txt", result);
  return result;
}

TEST(RunEvaluation, ALoopToAFrameAtMostHalfAFrameBeforeTheGroundTruthIsJudged) {
  for (const bool near : {true, false}) {
    const RunResult result = Judged(OneLoop(), TruthFrom(near ? 10.015 : 10.018));
    EXPECT_EQ(result.evaluation->loops_true, near ? 1 : 0);
    EXPECT_EQ(result.evaluation->loops_unknown, near ? 0 : 1);
    EXPECT_EQ(result.loops[0].correct, near ? std::optional<bool>(true) : std::nullopt);
  }
}

TEST(RunEvaluation, PositionsAloneJudgeTheDistanceOfALoop) {
  Trajectory positions = TruthFrom(10);
  for (StampedPose& pose : positions) pose.pose.rotation = Eigen::Quaterniond(0, 0, 0, 0);
  RunResult result = Judged(OneLoop(), positions);
  EXPECT_EQ(result.evaluation->loops_true, 1);
  EXPECT_TRUE(std::isnan(result.loop_errors[0].angle_deg));
  EXPECT_TRUE(std::isnan(result.loop_errors[0].error_deg));
  result.loops[0].S_candidate_query->translation = {0.3, 0, 0};
  result = Judged(result, positions);
  EXPECT_EQ(result.evaluation->loops_false, 1);
  EXPECT_NEAR(result.loop_errors[0].error_m, 0.3, 1e-9);
}

// A walk of 1 m/s ahead and back again: the loop's ends are in one place, 2 m of path apart.
Trajectory ThereAndBack(double metres) {
  Trajectory truth;
  for (double t = 10; t < 12.995; t += 0.01)
    truth.push_back({t, Pose(Eigen::Quaterniond::Identity(), {0, 0, metres * (t < 11 ? t - 10 : 12 - t)})});
  return truth;
}

RunResult OffBy(double error_m, double depth) {
  RunResult result = OneLoop();
  result.loops[0].S_candidate_query->translation = {error_m, 0, 0};
  result.map_figures.depth[60] = depth;
  return result;
}

TEST(RunEvaluation, ALoopMayBeOffByATenthOfTheDepthOrAShareOfThePath) {
  EXPECT_EQ(Judged(OffBy(0.3, 0), TruthFrom(10.015)).evaluation->loops_false, 1);
  EXPECT_EQ(Judged(OffBy(0.3, 2), ThereAndBack(1)).evaluation->loops_false, 1);
  EXPECT_EQ(Judged(OffBy(0.3, 4), ThereAndBack(1)).evaluation->loops_true, 1);
  EXPECT_EQ(Judged(OffBy(1.0, 20), ThereAndBack(1)).evaluation->loops_true, 1);
  EXPECT_EQ(Judged(OffBy(0.3, 2), ThereAndBack(10)).evaluation->loops_false, 1);
  EXPECT_EQ(Judged(OffBy(0.3, 2), ThereAndBack(100)).evaluation->loops_true, 1);
}

TEST(RunEvaluation, ALoopThatIsTurnedIsFalse) {
  RunResult result = OffBy(0, 100);
  result.loops[0].S_candidate_query->rotation = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY());
  result = Judged(result, ThereAndBack(1));
  EXPECT_EQ(result.evaluation->loops_false, 1);
  EXPECT_NEAR(result.loop_errors[0].error_deg, 0.2 * 57.29578, 1e-3);
}

TEST(RunEvaluation, OneCamerasLoopsAreJudgedInMetresInASmallRoomToo) {
  RunResult result = OneLoop();
  result.rig.sensor = Sensor::kMono;
  Trajectory truth;
  for (double t = 10; t < 12.995; t += 0.01) {
    const double angle = 3 * (t - 10);
    truth.push_back({t, Pose(Eigen::Quaterniond::Identity(), {2 * std::cos(angle), 0, 2 * std::sin(angle)})});
    result.trajectory.push_back(truth.back());
    result.trajectory.back().pose.translation *= 0.1;  // a unit of the map is 10 m
  }
  result.map_figures.depth[60] = 0.3;
  const Pose T_candidate_query = truth.front().pose.Inverse() * truth[200].pose;
  result.loops[0].S_candidate_query->translation = 0.1 * T_candidate_query.translation;
  const RunResult right = Judged(result, truth);
  EXPECT_EQ(right.evaluation->loops_true, 1);
  EXPECT_LT(right.loop_errors[0].error_m, 0.01);
  EXPECT_NEAR(right.loop_errors[0].distance_m, T_candidate_query.translation.norm(), 1e-3);
  result.loops[0].S_candidate_query->translation = {0, 0,
                                                    0};  // 0.6 m would do, 10 m would not have been seen
  EXPECT_EQ(Judged(result, truth).evaluation->loops_false, 1);
}

TEST(RunEvaluation, WithoutGroundTruthTheTrajectorySaysHowFarTheEndsAreApart) {
  RunResult result = OneLoop();
  result.trajectory = {{10, Pose()}, {12, Pose(Eigen::Quaterniond::Identity(), {3, 0, 4})}};
  MeasureLoops(result);
  ASSERT_EQ(result.loop_errors.size(), 1u);
  EXPECT_NEAR(result.loop_errors[0].distance_m, 5, 1e-12);
  EXPECT_NEAR(result.loop_errors[0].angle_deg, 0, 1e-9);
  EXPECT_TRUE(std::isnan(result.loop_errors[0].error_m));
  EXPECT_FALSE(result.loops[0].correct);
}

}  // namespace
}  // namespace tutti
