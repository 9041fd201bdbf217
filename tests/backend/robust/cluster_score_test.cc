#include "backend/robust/cluster_score.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti {
namespace {

TEST(ClusterScore, IsTheChiSquareOfWhatIsInAndALogarithmForEachClusterThatIsOut) {
  PoseGraph graph;
  graph.AddNode(0, Pose(), true);
  graph.AddNode(1, Pose());
  const auto at = [](double x) { return Similarity(1, Eigen::Quaterniond::Identity(), {x, 0, 0}); };
  graph.AddOdometry(0, 1, at(2), Matrix7d::Identity());                          // chi-square 4
  for (int k = 0; k < 5; ++k) graph.AddLoop(0, 1, at(3), Matrix7d::Identity());  // 9 each
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  const PoseGraphOptions options;
  internal::GraphProblem<6> problem(graph, structure, options);
  problem.SetPoses({Similarity(), Similarity()});
  const std::vector<internal::LoopCluster> clusters = {{1, 2, 3}, {4}, {5}};
  EXPECT_NEAR(internal::ClusterScore(problem, clusters, 10.0), 4 + 5 * 9, 1e-9);
  problem.SetWeight(1, 0);
  problem.SetWeight(3, 0);
  problem.SetWeight(4, 0);
  EXPECT_NEAR(internal::ClusterScore(problem, clusters, 5.0), 4 + 2 * 5 + 5 * (1 + std::log(2.0)) + 5, 1e-9)
      << "a loop costs no more inside than outside";
  EXPECT_EQ(internal::RejectedLoops(problem, clusters[0]), 2u);
  EXPECT_NEAR(internal::ClusterScore(problem, clusters, 10.0), 4 + 2 * 9 + 10 * (1 + std::log(2.0)) + 10,
              1e-9);
}

}  // namespace
}  // namespace tutti
