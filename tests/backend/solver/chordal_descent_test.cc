#include "backend/solver/chordal_descent.h"

#include <gtest/gtest.h>

#include "tests/backend/graph/synthetic_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

constexpr GraphKind kKinds[] = {GraphKind::kSE2, GraphKind::kSE3};

TEST(ChordalDescent, ReturnsToTheTruthWithoutNoise) {
  for (GraphKind kind : kKinds) {
    testing::SyntheticGraphOptions options;
    options.kind = kind;
    const testing::SyntheticGraph exact = testing::MakeSyntheticGraph(options);
    std::mt19937 random(3);
    std::vector<Similarity> poses = exact.truth;
    for (std::size_t k = 1; k < poses.size(); ++k)
      poses[k] = poses[k] * testing::RandomPose(kind, random, 0.3, 0.3);
    const internal::SolveSummary summary =
        MinimiseChordal(exact.graph, internal::AnalyseGraph(exact.graph), 200, 0, poses);
    EXPECT_TRUE(summary.converged) << summary.message;
    for (std::size_t k = 0; k < poses.size(); ++k)
      EXPECT_LT((poses[k].translation - exact.truth[k].translation).norm(), 1e-6) << k;
  }
}

// Steps to both sides of the minimum cost the same to first order, and more.
TEST(ChordalDescent, EndsWhereNoPoseCanMoveAndLowerTheCost) {
  for (GraphKind kind : kKinds) {
    const PoseGraph graph = testing::MakeSyntheticGraph(testing::NoisyOptions(kind, 0.05, 0.03)).graph;
    const internal::GraphStructure structure = internal::AnalyseGraph(graph);
    std::vector<Similarity> poses = testing::PosesOf(graph);
    const internal::SolveSummary summary = MinimiseChordal(graph, structure, 200, 0, poses);
    EXPECT_TRUE(summary.converged) << summary.message;
    EXPECT_LE(summary.iterations, 20);  // Newton's method, not a creep
    const double least = internal::ChordalCost(graph, poses);
    EXPECT_GT(least, 1);
    for (std::size_t k = 1; k < poses.size(); k += 17) {
      for (int axis = 0; axis < 3; ++axis) {
        const bool planar = kind == GraphKind::kSE2;
        const Eigen::Vector3d step = 1e-4 * Eigen::Vector3d::Unit(planar ? axis % 2 : axis);
        const Eigen::Vector3d turn = 1e-4 * Eigen::Vector3d::Unit(planar ? 2 : axis);
        std::vector<Similarity> moved = poses;
        double change[2];
        for (int side : {0, 1}) {
          const double sign = side == 0 ? 1 : -1;
          moved[k].translation = poses[k].translation + sign * step;
          moved[k].rotation = poses[k].rotation * ExpSO3(sign * turn);
          change[side] = internal::ChordalCost(graph, moved) - least;
        }
        EXPECT_GT(change[0], 0);
        EXPECT_GT(change[1], 0);
        EXPECT_NEAR(change[0] / change[1], 1, 1e-2);
      }
    }
  }
}

// Residuals of eleven degrees: with less than the exact second derivatives it takes dozens of steps.
TEST(ChordalDescent, ConvergesInAFewStepsHoweverNoisyTheGraph) {
  for (GraphKind kind : kKinds) {
    const testing::SyntheticGraph noisy = testing::MakeSyntheticGraph(testing::NoisyOptions(kind, 0.6, 0.2));
    std::vector<Similarity> poses = noisy.truth;
    const internal::SolveSummary summary =
        MinimiseChordal(noisy.graph, internal::AnalyseGraph(noisy.graph), 200, 0, poses);
    EXPECT_TRUE(summary.converged);
    EXPECT_LE(summary.iterations, 12) << ToString(kind);
  }
}

// From poses that are anywhere, where many a step leads uphill and has to be taken back.
TEST(ChordalDescent, NeverEndsHigherForOneIterationMore) {
  for (GraphKind kind : kKinds) {
    const testing::SyntheticGraph noisy = testing::MakeSyntheticGraph(testing::NoisyOptions(kind, 0.3, 0.2));
    const internal::GraphStructure structure = internal::AnalyseGraph(noisy.graph);
    for (unsigned seed = 1; seed <= 3; ++seed) {
      std::mt19937 random(seed);
      std::vector<Similarity> start = noisy.truth;
      for (std::size_t k = 1; k < start.size(); ++k) start[k] = testing::RandomPose(kind, random, 20, 2);
      double last = internal::ChordalCost(noisy.graph, start);
      int lower = 0;
      for (int iterations = 1; iterations <= 40; ++iterations) {
        std::vector<Similarity> poses = start;
        EXPECT_TRUE(MinimiseChordal(noisy.graph, structure, iterations, 0, poses).usable);
        const double cost = internal::ChordalCost(noisy.graph, poses);
        EXPECT_LE(cost, last * (1 + 1e-12)) << ToString(kind) << ", " << iterations << " iterations";
        lower += cost < last ? 1 : 0;
        last = cost;
      }
      EXPECT_GT(lower, 5);
    }
  }
}

TEST(ChordalDescent, FixedNodesAndAnchorsStay) {
  PoseGraph graph = testing::MakeSyntheticGraph(testing::NoisyOptions(GraphKind::kSE3, 0.1, 0.1)).graph;
  graph.SetFixed(17, true);
  graph.SetFixed(80, true);
  std::vector<Similarity> poses = testing::PosesOf(graph);
  EXPECT_TRUE(MinimiseChordal(graph, internal::AnalyseGraph(graph), 200, 0, poses).usable);
  for (const std::size_t k : {std::size_t{17}, std::size_t{80}})
    EXPECT_EQ(poses[k].translation, graph.nodes()[k].pose.translation);
  EXPECT_NE(poses[40].translation, graph.nodes()[40].pose.translation);
}

}  // namespace
}  // namespace tutti
