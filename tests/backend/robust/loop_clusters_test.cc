#include "backend/robust/loop_clusters.h"

#include <gtest/gtest.h>

#include "tutti/backend/pose_graph.h"

namespace tutti {
namespace {

using internal::LoopCluster;

constexpr double kAgreementThreshold = 16.8;

// A straight way of 200 m, a node a metre; without the step to `gap`, if there is one.
PoseGraph StraightWay(int gap = -1) {
  PoseGraph graph;
  const Similarity step(1, Eigen::Quaterniond::Identity(), {1, 0, 0});
  for (int k = 0; k < 200; ++k) {
    graph.AddNode(k, Pose(Eigen::Quaterniond::Identity(), {1.0 * k, 0, 0}));
    if (k > 0 && k != gap) graph.AddOdometry(k - 1, k, step, MakeInformation(0.1, 0.01));
  }
  return graph;
}

// "The same place", `off` beside it [m].
void AddRevisit(PoseGraph& graph, int from, int to, double off = 0) {
  graph.AddLoop(from, to, Similarity(1, Eigen::Quaterniond::Identity(), {0, off, 0}),
                MakeInformation(0.1, 0.01));
}

// Sizes in the order in which the clusters begin.
std::vector<std::size_t> ClusterSizes(const PoseGraph& graph) {
  std::vector<std::size_t> sizes;
  for (const LoopCluster& cluster : internal::ClusterLoops(graph, internal::AnalyseGraph(graph),
                                                           GraphObjective::kChi2Log, kAgreementThreshold))
    sizes.push_back(cluster.size());
  return sizes;
}

TEST(LoopClusters, NeighboursThatAgreeAreOneClusterWhicheverWayTheyPoint) {
  PoseGraph graph = StraightWay();
  for (int k = 0; k < 30; k += 3) AddRevisit(graph, k % 2 == 0 ? k : 150 + k, k % 2 == 0 ? 150 + k : k);
  EXPECT_EQ(ClusterSizes(graph), (std::vector<std::size_t>{10}));
}

TEST(LoopClusters, ListTheirLoopsByTheEarlierEnd) {
  PoseGraph graph = StraightWay();
  const std::size_t odometry = graph.edges().size();
  AddRevisit(graph, 159, 9);
  AddRevisit(graph, 3, 153);
  AddRevisit(graph, 6, 156);
  const std::vector<LoopCluster> clusters = internal::ClusterLoops(
      graph, internal::AnalyseGraph(graph), GraphObjective::kChi2Log, kAgreementThreshold);
  ASSERT_EQ(clusters.size(), 1u);
  EXPECT_EQ(clusters[0], (LoopCluster{odometry + 1, odometry + 2, odometry}));
}

TEST(LoopClusters, OneThatContradictsItsNeighboursStandsAlone) {
  PoseGraph graph = StraightWay();
  for (int k = 0; k < 8; ++k) AddRevisit(graph, k, 150 + k, k == 4 ? 5.0 : 0.0);
  EXPECT_EQ(ClusterSizes(graph), (std::vector<std::size_t>{7, 1}));
}

TEST(LoopClusters, EndWhereTheNextLoopIsFarAway) {
  PoseGraph graph = StraightWay();
  for (const int k : {0, 10, 21, 22}) AddRevisit(graph, k, 150 + k);
  EXPECT_EQ(ClusterSizes(graph), (std::vector<std::size_t>{2, 2})) << "11 nodes between";
}

TEST(LoopClusters, EndAtAGapOfTheOdometry) {
  PoseGraph graph = StraightWay(153);
  for (int k = 0; k < 6; ++k) AddRevisit(graph, k, 150 + k);
  EXPECT_EQ(ClusterSizes(graph), (std::vector<std::size_t>{3, 3}));
}

}  // namespace
}  // namespace tutti
