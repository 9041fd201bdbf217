#include "tutti/backend/online_optimizer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/backend/graph/synthetic_graph.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::MakeSyntheticGraph;
using testing::SyntheticGraph;
using testing::SyntheticGraphOptions;

PoseGraphOptions InParts(RobustLoss robust = RobustLoss::kHuber) {
  PoseGraphOptions options;
  options.solver = PoseGraphSolver::kBlock;
  options.init = GraphInit::kFile;
  options.robust = robust;
  return options;
}

/// Two rounds of a circle whose second meets the first every few nodes, so that loops are local.
SyntheticGraph TwoRounds(GraphKind kind) {
  SyntheticGraphOptions options = testing::NoisyOptions(kind, 0.02, 0.002);
  options.nodes = 400;
  options.loops = 100;
  return MakeSyntheticGraph(options);
}

/// Adds the nodes of `file` one by one, each where the odometry puts it, and optimises at every loop.
template <typename Optimise>
PoseGraph Grow(const PoseGraph& file, Optimise optimise) {
  PoseGraph graph(file.kind());
  for (const PoseGraphNode& node : file.nodes()) {
    Similarity pose = node.pose;
    std::vector<PoseGraphEdge> arriving;
    bool loop = false;
    for (const PoseGraphEdge& edge : file.edges()) {
      if (std::max(edge.from, edge.to) != node.id) continue;
      arriving.push_back(edge);
      loop = loop || edge.kind == EdgeKind::kLoop;
      if (edge.kind == EdgeKind::kOdometry) pose = graph.Node(edge.from).pose * edge.measurement;
    }
    graph.AddNode(node.id, pose);
    for (const PoseGraphEdge& edge : arriving) graph.AddEdge(edge);
    if (loop) optimise(graph);
  }
  return graph;
}

/// Grows a graph and compares with the optimum of the whole; returns the share of keyframes that were solved
/// for, over all loops.
double GrowsToTheOptimum(GraphKind kind, const OnlineOptions& options) {
  OnlineOptimizer online(InParts(), options);
  double solved = 0, all = 0;
  const PoseGraph grown = Grow(TwoRounds(kind).graph, [&](PoseGraph& graph) {
    const OnlineReport report = online.Optimize(graph);
    ASSERT_TRUE(report.success) << report.reason;
    solved += static_cast<double>(report.nodes);
    all += static_cast<double>(graph.nodes().size());
  });
  PoseGraph optimum = grown;
  PoseGraphOptions precise = InParts();
  precise.function_tolerance = 1e-12;
  const PoseGraphReport report = PoseGraphOptimizer(precise).Optimize(optimum);
  EXPECT_TRUE(report.success);
  // The excess of chi-square is the squared distance from the optimum in standard deviations, over all of the
  // graph's 1200 to 2800 coordinates together.
  EXPECT_LT(report.initial_objective - report.objective, 0.5 * 0.5) << ToString(kind);
  return solved / all;
}

TEST(OnlineOptimizer, ManySmallSolutionsEndWhereOneLargeOneDoes) {
  OnlineOptions never_whole;
  never_whole.whole_fraction = 1;
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    GrowsToTheOptimum(kind, {});
    EXPECT_LT(GrowsToTheOptimum(kind, never_whole), 0.9) << ToString(kind);
  }
}

TEST(OnlineOptimizer, WhatALoopDoesNotReachStaysToTheBit) {
  OnlineOptimizer online(InParts());
  PoseGraph graph = TwoRounds(GraphKind::kSE3).graph;
  ASSERT_TRUE(online.Optimize(graph).success);
  const PoseGraph before = graph;
  Similarity measured = graph.Node(210).pose.Inverse() * graph.Node(214).pose;
  measured.translation.x() += 0.03;
  graph.AddLoop(210, 214, measured, MakeInformation(0.02, 0.002));
  const OnlineReport report = online.Optimize(graph);
  EXPECT_TRUE(report.success);
  EXPECT_FALSE(report.whole);
  EXPECT_GT(report.nodes, 4u);
  EXPECT_NE(graph.Node(212).pose.translation, before.Node(212).pose.translation);
  std::size_t moved = 0;
  for (const PoseGraphNode& node : graph.nodes())
    moved += node.pose.translation != before.Node(node.id).pose.translation ? 1 : 0;
  EXPECT_LE(moved, report.nodes);
}

TEST(OnlineOptimizer, NothingNewIsNothingToDo) {
  OnlineOptimizer online(InParts());
  PoseGraph graph = TwoRounds(GraphKind::kSE3).graph;
  const OnlineReport first = online.Optimize(graph);
  EXPECT_TRUE(first.whole);
  const OnlineReport second = online.Optimize(graph);
  EXPECT_TRUE(second.success);
  EXPECT_EQ(second.nodes, 0u);
  ASSERT_EQ(second.edges.size(), first.edges.size());
  for (std::size_t e = 0; e < first.edges.size(); ++e) EXPECT_EQ(second.edges[e].chi2, first.edges[e].chi2);
}

TEST(OnlineOptimizer, ALoopThatIsTakenOutAgainLeavesNoTrace) {
  OnlineOptimizer online(InParts());
  PoseGraph graph = TwoRounds(GraphKind::kSE3).graph;
  online.Optimize(graph);
  const PoseGraph before = graph;
  PoseGraph with = graph;
  with.AddLoop(20, 130, Similarity(1, Eigen::Quaterniond::Identity(), {0.4, 0, 0}),
               MakeInformation(0.02, 0.002));
  EXPECT_TRUE(online.Optimize(with).success);
  PoseGraph without = before;
  for (const PoseGraphNode& node : with.nodes()) without.SetPose(node.id, node.pose);
  EXPECT_TRUE(online.Optimize(without).success);
  double chi2[2] = {0, 0};
  for (const PoseGraphEdge& edge : before.edges()) {
    chi2[0] += EdgeChi2(before, edge, GraphObjective::kChi2Log);
    chi2[1] += EdgeChi2(without, edge, GraphObjective::kChi2Log);
  }
  EXPECT_NEAR(chi2[1], chi2[0], 0.1);
}

TEST(OnlineOptimizer, APartThatALoopTiesToAnotherIsLetGo) {
  PoseGraph graph;
  const auto at = [](double x) { return Similarity(1, Eigen::Quaterniond::Identity(), {x, 0, 0}); };
  for (int id = 0; id < 20; ++id) graph.AddNode(id, at(1.0 * id + (id < 10 ? 0 : 5)));
  for (int id = 1; id < 20; ++id) {
    if (id != 10) graph.AddOdometry(id - 1, id, at(1), Matrix7d::Identity());
  }
  OnlineOptimizer online(InParts(RobustLoss::kNone));
  EXPECT_EQ(online.Optimize(graph).nodes, 0u);
  graph.AddLoop(9, 10, at(1), Matrix7d::Identity());
  EXPECT_TRUE(online.Optimize(graph).success);
  EXPECT_NEAR(graph.Node(19).pose.translation.x(), 19, 0.2) << "node 10 held the second part before";
}

TEST(OnlineOptimizer, WhatPartsCanNotDoIsSolvedAsAWholeAndSaysSo) {
  for (PoseGraphOptions options : {InParts(RobustLoss::kGnc), InParts(RobustLoss::kSwitchable)}) {
    OnlineOptimizer online(options);
    PoseGraph graph = TwoRounds(GraphKind::kSE3).graph, same = graph;
    const OnlineReport report = online.Optimize(graph);
    EXPECT_TRUE(report.whole);
    EXPECT_EQ(report.nodes, graph.nodes().size());
    PoseGraphOptimizer(options).Optimize(same);
    EXPECT_EQ(graph.Node(200).pose.translation, same.Node(200).pose.translation);
  }
  PoseGraphOptions ceres = InParts();
  ceres.solver = PoseGraphSolver::kCeres;
  OnlineOptimizer online(ceres);
  PoseGraph graph = TwoRounds(GraphKind::kSE3).graph;
  online.Optimize(graph);
  EXPECT_EQ(online.Optimize(graph).nodes, graph.nodes().size());
}

TEST(OnlineOptimizer, SmallGraphsAreLeftToCeresAndLargeOnesAreSolvedInParts) {
  PoseGraphOptions ceres = InParts();
  ceres.solver = PoseGraphSolver::kCeres;
  OnlineOptions online;
  online.parts_from_nodes = 300;
  online.whole_fraction = 1;
  OnlineOptimizer optimizer(ceres, online), always_ceres(ceres);
  std::size_t small = 0, in_parts = 0;
  Grow(TwoRounds(GraphKind::kSE3).graph, [&](PoseGraph& graph) {
    PoseGraph same = graph;
    const OnlineReport report = optimizer.Optimize(graph);
    ASSERT_TRUE(report.success) << report.reason;
    if (graph.nodes().size() < online.parts_from_nodes) {
      ++small;
      EXPECT_TRUE(report.whole);
      ASSERT_TRUE(always_ceres.Optimize(same).success);
      EXPECT_EQ(graph.Node(120).pose.translation, same.Node(120).pose.translation);
    } else if (!report.whole) {
      ++in_parts;
    }
  });
  EXPECT_GT(small, 10u);
  EXPECT_GT(in_parts, 10u);
}

TEST(OnlineOptimizer, TheSameSequenceGivesTheSameBits) {
  const PoseGraph file = TwoRounds(GraphKind::kSE3).graph;
  OnlineOptimizer a(InParts()), b(InParts());
  const PoseGraph first = Grow(file, [&](PoseGraph& graph) { a.Optimize(graph); });
  const PoseGraph second = Grow(file, [&](PoseGraph& graph) { b.Optimize(graph); });
  for (const PoseGraphNode& node : first.nodes())
    EXPECT_EQ(node.pose.translation, second.Node(node.id).pose.translation);
}

TEST(OnlineOptimizer, FailureLeavesTheGraphAloneAndTheNextCallWorks) {
  OnlineOptimizer online(InParts(RobustLoss::kNone));
  PoseGraph graph = testing::OverflowingGraph();
  const OnlineReport report = online.Optimize(graph);
  EXPECT_FALSE(report.success);
  EXPECT_NE(report.reason, "");
  EXPECT_EQ(graph.Node(1).pose.translation.x(), 1e300);
  graph.SetPose(1, Similarity(1, Eigen::Quaterniond::Identity(), {2, 0, 0}));
  EXPECT_TRUE(online.Optimize(graph).success);
  EXPECT_NEAR(graph.Node(1).pose.translation.x(), 0, 0.01);
}

TEST(OnlineOptimizer, RefusesOptionsThatMakeNoSenseAndNodesWithoutAPose) {
  OnlineOptions bad;
  bad.settled_sigmas = 0;
  EXPECT_THROW(OnlineOptimizer(InParts(), bad), InputError);
  bad = {};
  bad.whole_fraction = 1.5;
  EXPECT_THROW(OnlineOptimizer(InParts(), bad), InputError);
  PoseGraph graph;
  graph.AddNode(PoseGraphNode{0, Similarity(), false, false});
  OnlineOptimizer online(InParts());
  const OnlineReport report = online.Optimize(graph);
  EXPECT_FALSE(report.success);
  EXPECT_NE(report.reason.find("node 0"), std::string::npos);
}

}  // namespace
}  // namespace tutti
