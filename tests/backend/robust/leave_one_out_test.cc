#include <gtest/gtest.h>

#include "backend/robust/robust_solver.h"
#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

PoseGraph SolvedGraph(GraphKind kind) {
  PoseGraph graph = testing::MakeSyntheticGraph(testing::NoisyOptions(kind, 0.02, 0.004)).graph;
  PoseGraphOptimizer().Optimize(graph);
  return graph;
}

PoseGraph Without(const PoseGraph& graph, std::size_t left_out) {
  PoseGraph out(graph.kind());
  for (const PoseGraphNode& node : graph.nodes()) out.AddNode(node);
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    if (e != left_out) out.AddEdge(graph.edges()[e]);
  }
  return out;
}

TEST(LeaveOneOut, IsWhatTheCostFallsByWhenTheEdgeLeaves) {
  for (const GraphKind kind : testing::kGraphKinds) {
    const testing::ProblemAtPoses made(SolvedGraph(kind));
    std::vector<std::size_t> edges;
    for (std::size_t e = 119; e < made.graph.edges().size(); e += 9) edges.push_back(e);
    const std::vector<double> chi2 = internal::LeaveOneOutChi2(*made.problem, edges);
    ASSERT_EQ(chi2.size(), edges.size());
    const double all = EvaluateCosts(made.graph).chi2log;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      PoseGraph rest = Without(made.graph, edges[k]);
      const double fall = all - PoseGraphOptimizer().Optimize(rest).costs.chi2log;
      EXPECT_NEAR(chi2[k], fall, 0.03 * fall + 1e-3) << ToString(kind) << " edge " << edges[k];
      EXPECT_GT(chi2[k], made.problem->EdgeChi2(edges[k]));
    }
  }
}

TEST(LeaveOneOut, IsZeroForAnEdgeThatAloneHoldsItsEnds) {
  PoseGraph graph;
  std::mt19937 random(2);
  graph.AddNode(0, Similarity());
  Similarity pose;
  for (int id = 1; id < 4; ++id) {
    const Similarity step = testing::RandomPose(GraphKind::kSE3, random, 1, 1);
    pose = pose * step;
    graph.AddNode(id, pose);
    graph.AddLoop(id - 1, id, step, testing::RandomInformation(random));
  }
  const std::vector<double> chi2 =
      internal::LeaveOneOutChi2(*testing::ProblemAtPoses(graph).problem, {0, 1, 2});
  ASSERT_EQ(chi2.size(), 3u);
  for (const double one : chi2) EXPECT_LT(one, 1e-9);
}

}  // namespace
}  // namespace tutti
