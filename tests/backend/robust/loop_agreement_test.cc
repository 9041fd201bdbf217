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

}  // namespace
}  // namespace tutti
