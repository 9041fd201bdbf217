#include "backend/graph/graph_memory.h"

#include <gtest/gtest.h>

#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

using internal::GraphChanges;
using internal::GraphMemory;
using Positions = std::vector<std::size_t>;

Similarity At(double x) { return Similarity(1, Eigen::Quaterniond::Identity(), {x, 0, 0}); }

PoseGraph Chain(int nodes) {
  PoseGraph graph;
  for (int k = 0; k < nodes; ++k) {
    graph.AddNode(k, At(k));
    if (k > 0) graph.AddOdometry(k - 1, k, At(1), Matrix7d::Identity());
  }
  return graph;
}

TEST(GraphMemory, AtFirstEverythingIsNew) {
  GraphMemory memory;
  const GraphChanges changes = memory.Update(Chain(3));
  EXPECT_EQ(changes.edge_before, Positions(2, GraphChanges::kNew));
  EXPECT_EQ(changes.touched, (Positions{0, 1, 2}));
}

TEST(GraphMemory, TheSameGraphAgainIsNoChange) {
  GraphMemory memory;
  memory.Update(Chain(4));
  const GraphChanges changes = memory.Update(Chain(4));
  EXPECT_EQ(changes.edge_before, (Positions{0, 1, 2}));
  EXPECT_TRUE(changes.touched.empty());
}

TEST(GraphMemory, AppendedNodesAndEdgesTouchTheirEnds) {
  GraphMemory memory;
  memory.Update(Chain(4));
  PoseGraph graph = Chain(5);
  graph.AddLoop(1, 4, At(3), Matrix7d::Identity());
  const GraphChanges changes = memory.Update(graph);
  EXPECT_EQ(changes.edge_before, (Positions{0, 1, 2, GraphChanges::kNew, GraphChanges::kNew}));
  EXPECT_EQ(changes.touched, (Positions{1, 3, 4}));
}

TEST(GraphMemory, ChangedEdgesAndMovedHeldAndNewNodesAreFound) {
  PoseGraph graph = Chain(6);
  GraphMemory memory;
  memory.Update(graph);
  graph.SetPose(5, At(5.5));
  EXPECT_EQ(memory.Update(graph).touched, Positions{5});
  graph.SetFixed(3, true);
  EXPECT_EQ(memory.Update(graph).touched, Positions{3});
  PoseGraph other;
  for (const PoseGraphNode& node : graph.nodes()) other.AddNode(node);
  for (PoseGraphEdge edge : graph.edges()) {
    if (edge.from == 1) edge.information *= 2;
    other.AddEdge(edge);
  }
  const GraphChanges changes = memory.Update(other);
  EXPECT_EQ(changes.edge_before, (Positions{0, GraphChanges::kNew, 2, 3, 4}));
  EXPECT_EQ(changes.touched, (Positions{1, 2}));
}

TEST(GraphMemory, EdgesThatMoveInTheListAndNodesThatLeaveAreFollowed) {
  GraphMemory memory;
  PoseGraph before = Chain(5);
  before.AddLoop(0, 4, At(4), Matrix7d::Identity());
  memory.Update(before);
  PoseGraph after;  // without node 0, with another edge in the middle
  for (int k = 1; k < 5; ++k) after.AddNode(before.Node(k));
  after.AddEdge(before.edges()[1]);
  after.AddOdometry(1, 3, At(2), Matrix7d::Identity());
  after.AddEdge(before.edges()[2]);
  after.AddEdge(before.edges()[3]);
  const GraphChanges changes = memory.Update(after);
  EXPECT_EQ(changes.edge_before, (Positions{1, GraphChanges::kNew, 2, 3}));
  EXPECT_EQ(changes.touched, (Positions{0, 2, 3})) << "ends of the new edge and of those that left: 1, 3, 4";
}

TEST(GraphMemory, ASecondEdgeBetweenTheSameNodesIsNew) {
  GraphMemory memory;
  PoseGraph graph = Chain(3);
  memory.Update(graph);
  graph.AddEdge(graph.edges()[0]);
  EXPECT_EQ(memory.Update(graph).edge_before, (Positions{0, 1, GraphChanges::kNew}));
  EXPECT_EQ(memory.Update(graph).edge_before, (Positions{0, 1, 2}));
}

}  // namespace
}  // namespace tutti
