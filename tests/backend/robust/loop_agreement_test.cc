#include "backend/robust/loop_agreement.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tutti/backend/pose_graph.h"

namespace tutti {
namespace {

constexpr double kSigmaStep = 0.1, kSigmaLoop = 0.2;  // [m]
constexpr double kSigmaTurn = 1e-5;                   // next to nothing [rad]

// A chain of nodes, a metre and a little turn from one to the next.
PoseGraph Chain(GraphKind kind, int nodes) {
  PoseGraph graph(kind);
  const Pose step(ExpSO3({0, 0, 0.05}), {1, 0, 0});
  Pose T_world_node;
  for (int k = 0; k < nodes; ++k) {
    graph.AddNode(k, T_world_node);
    T_world_node = T_world_node * step;
    if (k > 0) graph.AddOdometry(k - 1, k, Similarity(step), MakeInformation(kSigmaStep, kSigmaTurn));
  }
  return graph;
}

// A loop that is off by so much [m].
void AddLoop(PoseGraph& graph, int from, int to, const Eigen::Vector3d& off) {
  Similarity measurement = graph.Node(from).pose.Inverse() * graph.Node(to).pose;
  measurement.translation += off;
  graph.AddLoop(from, to, measurement, MakeInformation(kSigmaLoop, kSigmaTurn));
}

// One begins a node later than the other and ends two later: three steps of odometry, and the loops
// themselves.
TEST(LoopAgreement, TheCycleHasTheCovariancesOfItsLoopsAndOfTheOdometry) {
  const double sigma = std::sqrt(2 * kSigmaLoop * kSigmaLoop + 3 * kSigmaStep * kSigmaStep);
  for (const GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3}) {
    for (const Eigen::Vector3d& direction : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(-0.6, 0.8, 0)}) {
      for (const bool turned : {false, true}) {
        PoseGraph graph = Chain(kind, 20);
        AddLoop(graph, turned ? 12 : 2, turned ? 2 : 12, Eigen::Vector3d::Zero());
        AddLoop(graph, turned ? 14 : 3, turned ? 3 : 14, 3 * sigma * direction);
        const internal::LoopAgreement agreement(graph, internal::AnalyseGraph(graph),
                                                GraphObjective::kChi2Log);
        ASSERT_EQ(agreement.loops().size(), 2u);
        EXPECT_NEAR(agreement.CycleChi2(agreement.loops()[0], agreement.loops()[1]), 9, 0.12);
      }
    }
  }
}

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
