#include "apps/slam/loop_solver.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti {
namespace {

// Keyframe k of 40 on a straight line, 1 m apart; the map has drifted by a metre at the end of it, evenly.
KeyframeGraph Line() {
  std::vector<MapKeyframe> keyframes;
  keyframes.reserve(40);
  for (int k = 0; k < 40; ++k) keyframes.push_back({k, 0, Pose({1, 0, 0, 0}, {k + k / 40.0, 0, 0})});
  KeyframeGraphOptions options;
  options.solver.robust = RobustLoss::kHuber;
  options.sigma_translation_ratio = 0.05;
  KeyframeGraph graph(options);
  graph.Update(keyframes);
  return graph;
}

// The truth, 39 m, or off by `error` [m].
LoopEdge EdgeOf(std::size_t record, int candidate, int query, double error = 0) {
  LoopEdge loop;
  loop.candidate = candidate;
  loop.query = query;
  loop.S_candidate_query.translation = {query - candidate + error, 0, 0};
  loop.information = MakeInformation(0.05, 0.01);
  loop.depth = 10;
  loop.record = record;
  return loop;
}

TEST(LoopSolver, ATrueLoopMovesTheMapOntoIt) {
  const LoopSolution solution = SolveLoops(Line(), {}, {EdgeOf(0, 0, 39)}, SlamOptions());
  ASSERT_TRUE(solution.moves);
  EXPECT_EQ(solution.verdicts[0].reason, "");
  EXPECT_GT(solution.verdicts[0].weight, 0);
  const auto& poses = solution.correction.S_world_keyframe;
  EXPECT_NEAR((poses.at(39).translation - poses.at(0).translation).norm(), 39, 0.3);
}

TEST(LoopSolver, ALoopThatContradictsTheOthersLeavesWithItsReason) {
  const std::vector<LoopEdge> accepted = {EdgeOf(0, 0, 39), EdgeOf(1, 1, 38), EdgeOf(2, 2, 37)};
  const LoopSolution solution =
      SolveLoops(Line(), accepted, {EdgeOf(3, 3, 36), EdgeOf(4, 0, 39, -20)}, SlamOptions());
  ASSERT_TRUE(solution.moves);
  EXPECT_EQ(solution.verdicts[0].reason, "");
  EXPECT_NE(solution.verdicts[1].reason, "");
  EXPECT_TRUE(solution.verdicts[1].contradicted);
  EXPECT_EQ(solution.correction.loops.size(), accepted.size() + 1);
}

// As far as Huber's loss lets it, the map bends to it: only its weight tells.
TEST(LoopSolver, ALoopThatKeepsLessThanHalfOfItsWeightLeaves) {
  const auto verdict = [](double error) {
    return SolveLoops(Line(), {}, {EdgeOf(0, 0, 39, error)}, SlamOptions()).verdicts[0];
  };
  EXPECT_EQ(verdict(-8).reason, "");
  EXPECT_NE(verdict(-8.7).reason.find("leaves it 33 % of its weight"), std::string::npos);
  EXPECT_TRUE(verdict(-8.7).contradicted);
}

// The camera seemed to slide by half a metre to keyframe 20. Loops across that step say that it did not.
TEST(LoopSolver, LoopsThatAgreeOverruleAStepThatIsKnownToBeWeak) {
  const std::vector<LoopEdge> loops = {EdgeOf(0, 17, 22), EdgeOf(1, 18, 23), EdgeOf(2, 16, 24)};
  const auto solve = [&](bool weak) {
    std::vector<MapKeyframe> keyframes;
    for (int k = 0; k < 40; ++k)
      keyframes.push_back({k, 0, Pose({1, 0, 0, 0}, {k + (k < 20 ? 0 : 1.5), 0, 0})});
    KeyframeGraphOptions options;
    options.sigma_translation_ratio = 0.001;
    KeyframeGraph graph(options);
    for (int k = 1; k < 40; ++k) graph.NoteMotion(k, weak && k == 20 ? MotionSigma{1.5, 0} : MotionSigma());
    graph.Update(keyframes);
    return SolveLoops(graph, {}, loops, SlamOptions());
  };
  EXPECT_FALSE(solve(false).moves);
  const LoopSolution solution = solve(true);
  ASSERT_TRUE(solution.moves);
  const auto& poses = solution.correction.S_world_keyframe;
  EXPECT_NEAR((poses.at(20).translation - poses.at(19).translation).norm(), 1, 0.05);
  EXPECT_NEAR((poses.at(39).translation - poses.at(20).translation).norm(), 19, 0.01);
}

TEST(LoopSolver, NothingMovesWhereNoneMayStay) {
  const LoopSolution solution =
      SolveLoops(Line(), {EdgeOf(0, 0, 39)}, {EdgeOf(1, 0, 39, -20)}, SlamOptions());
  EXPECT_FALSE(solution.moves);
  EXPECT_TRUE(solution.verdicts[0].contradicted);
}

TEST(LoopSolver, TheGateRefusesWhatTheMapCanNotHaveDriftedTo) {
  SlamOptions options;
  options.loop_gate_sigmas = 5;
  const LoopSolution solution = SolveLoops(Line(), {}, {EdgeOf(0, 0, 39), EdgeOf(1, 0, 39, -30)}, options);
  ASSERT_TRUE(solution.moves);
  ASSERT_TRUE(solution.verdicts[0].gate_sigmas && solution.verdicts[1].gate_sigmas);
  EXPECT_LT(*solution.verdicts[0].gate_sigmas, 5);
  EXPECT_GT(*solution.verdicts[1].gate_sigmas, 5);
  EXPECT_EQ(solution.verdicts[1].weight, 0) << "it never was in the graph";
}

TEST(LoopSolver, BesideTheTrackingItFindsTheSame) {
  const LoopSolution here = SolveLoops(Line(), {}, {EdgeOf(0, 0, 39)}, SlamOptions());
  for (const int threads : {1, 2}) {
    SlamOptions options;
    options.threads = threads;
    BackgroundLoopSolver solver;
    EXPECT_FALSE(solver.Running());
    solver.Start(Line(), {}, {EdgeOf(0, 0, 39)}, options, nullptr);
    EXPECT_TRUE(solver.Running());
    const LoopSolution there = solver.Take();
    EXPECT_FALSE(solver.Running());
    for (const auto& [id, pose] : here.correction.S_world_keyframe)
      EXPECT_EQ(pose.translation, there.correction.S_world_keyframe.at(id).translation);
  }
}

TEST(Follow, KeepsWhatMappingFoundAndTakesNewKeyframesAlong) {
  const Pose identity;
  const std::vector<MapKeyframe> then = {{0, 0, identity}, {1, 0, Pose(identity.rotation, {1, 0, 0})}};
  std::vector<MapKeyframe> now = then;
  now[1].T_world_keyframe.translation.y() = 0.25;             // mapping moved it
  now.push_back({2, 0, Pose(identity.rotation, {2, 0, 0})});  // came since
  now.push_back({3, 1, Pose(identity.rotation, {7, 7, 7})});  // in another piece
  KeyframeCorrection solved;
  solved.S_world_keyframe = {{0, Similarity(identity)}, {1, Similarity(1, identity.rotation, {1, 10, 0})}};
  const std::map<int, Similarity> moved = MovedAsSolved(solved, then, now);
  EXPECT_EQ(moved.at(0).translation, Eigen::Vector3d(0, 0, 0));
  EXPECT_LT((moved.at(1).translation - Eigen::Vector3d(1, 10.25, 0)).norm(), 1e-12);
  EXPECT_LT((moved.at(2).translation - Eigen::Vector3d(2, 10, 0)).norm(), 1e-12);
  EXPECT_EQ(moved.at(3).translation, Eigen::Vector3d(7, 7, 7));
}

TEST(Disagreement, IsMeasuredInTheUnitsOfTheScene) {
  const Disagreement d = Measure(Similarity(std::exp(0.1), ExpSO3({0, 0, 0.01}), {3, 4, 0}), 10);
  EXPECT_NEAR(d.fraction, 0.5, 1e-12);
  EXPECT_NEAR(d.angle_deg, 0.01 * 180 / M_PI, 1e-9);
  EXPECT_NEAR(d.log_scale, 0.1, 1e-12);
}

}  // namespace
}  // namespace tutti
