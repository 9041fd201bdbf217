#include "backend/robust/leave_one_out.h"

#include <gtest/gtest.h>

#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

using internal::GraphProblem;
using internal::LeaveOneOut;

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

template <int N>
void ExpectTheFallOfTheCost(const PoseGraph& graph) {
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  const PoseGraphOptions options;
  GraphProblem<N> problem(graph, structure, options);
  std::vector<Similarity> poses;
  for (const PoseGraphNode& node : graph.nodes()) poses.push_back(node.pose);
  problem.SetPoses(poses);
  const LeaveOneOut<N> without(problem, graph.edges().size());
  ASSERT_TRUE(without.Ok());
  const double all = EvaluateCosts(graph).chi2log;
  for (std::size_t e = 119; e < graph.edges().size(); e += 9) {
    PoseGraph rest = Without(graph, e);
    const double fall = all - PoseGraphOptimizer().Optimize(rest).costs.chi2log;
    EXPECT_NEAR(without.Chi2(e), fall, 0.03 * fall + 1e-3) << ToString(graph.kind()) << " edge " << e;
    EXPECT_GT(without.Chi2(e), problem.EdgeChi2(e));
  }
}

TEST(LeaveOneOut, IsWhatTheCostFallsByWhenTheEdgeLeaves) {
  ExpectTheFallOfTheCost<3>(SolvedGraph(testing::kGraphKinds[0]));
  ExpectTheFallOfTheCost<6>(SolvedGraph(testing::kGraphKinds[1]));
  ExpectTheFallOfTheCost<7>(SolvedGraph(testing::kGraphKinds[2]));
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
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  const PoseGraphOptions options;
  GraphProblem<6> problem(graph, structure, options);
  std::vector<Similarity> poses;
  for (const PoseGraphNode& node : graph.nodes()) poses.push_back(node.pose);
  problem.SetPoses(poses);
  const LeaveOneOut<6> without(problem, graph.edges().size());
  ASSERT_TRUE(without.Ok());
  for (std::size_t e = 0; e < 3; ++e) EXPECT_LT(without.Chi2(e), 1e-9);
}

}  // namespace
}  // namespace tutti
