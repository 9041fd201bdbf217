#include "backend/robust/pairwise_consistency.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

constexpr double kSigmaStep = 0.1, kSigmaLoop = 0.2;  // [m]
constexpr double kSigmaTurn = 1e-5;                   // next to nothing [rad]
constexpr double kThreshold = 9;                      // three standard deviations

// A chain of nodes, a metre and a little turn from one to the next; without the step to `gap`, if there is
// one.
PoseGraph Chain(GraphKind kind, int nodes, int gap = -1) {
  PoseGraph graph(kind);
  const Pose step(ExpSO3({0, 0, 0.05}), {1, 0, 0});
  Pose T_world_node;
  for (int k = 0; k < nodes; ++k) {
    graph.AddNode(k, T_world_node);
    T_world_node = T_world_node * step;
    if (k > 0 && k != gap)
      graph.AddOdometry(k - 1, k, Similarity(step), MakeInformation(kSigmaStep, kSigmaTurn));
  }
  return graph;
}

// A loop that is off by so much [m].
void AddLoop(PoseGraph& graph, int from, int to, const Eigen::Vector3d& off) {
  Similarity measurement = graph.Node(from).pose.Inverse() * graph.Node(to).pose;
  measurement.translation += off;
  graph.AddLoop(from, to, measurement, MakeInformation(kSigmaLoop, kSigmaTurn));
}

std::vector<bool> Kept(const PoseGraph& graph) {
  return PairwiseConsistentEdges(graph, internal::AnalyseGraph(graph), GraphObjective::kChi2Log, kThreshold);
}

std::size_t NumKept(const PoseGraph& graph) {
  const std::vector<bool> kept = Kept(graph);
  return static_cast<std::size_t>(std::count(kept.begin(), kept.end(), true));
}

// One begins a node later than the other and ends two later: three steps of odometry, and the loops
// themselves.
TEST(PairwiseConsistency, LoopsAgreeWithinTheCovariancesOfTheirCycle) {
  const double sigma = std::sqrt(2 * kSigmaLoop * kSigmaLoop + 3 * kSigmaStep * kSigmaStep);
  for (const GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3}) {
    for (const Eigen::Vector3d& direction : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(-0.6, 0.8, 0)}) {
      for (const bool turned : {false, true}) {
        for (const double sigmas : {2.98, 3.02}) {
          PoseGraph graph = Chain(kind, 20);
          AddLoop(graph, turned ? 12 : 2, turned ? 2 : 12, Eigen::Vector3d::Zero());
          AddLoop(graph, turned ? 14 : 3, turned ? 3 : 14, sigmas * sigma * direction);
          EXPECT_EQ(NumKept(graph), graph.edges().size() - (sigmas < 3 ? 0 : 1)) << sigmas;
        }
      }
    }
  }
}

TEST(PairwiseConsistency, LoopsAcrossAGapOfTheOdometryAreTakenToAgree) {
  for (const int gap : {-1, 6, 15}) {  // the second one is between the loops' ends, on both ways round
    PoseGraph graph = Chain(GraphKind::kSE3, 20, gap);
    AddLoop(graph, 2, 12, Eigen::Vector3d::Zero());
    AddLoop(graph, 3, 17, {0, 5, 0});
    EXPECT_EQ(NumKept(graph), graph.edges().size() - (gap == 15 ? 0 : 1)) << gap;
  }
}

// Rows of bits are stored in words of 64.
TEST(PairwiseConsistency, AWrongLoopIsDroppedAtWhateverPositionItStands) {
  constexpr int kLoops = 140;
  PoseGraph graph = Chain(GraphKind::kSE2, 400);
  std::vector<bool> expected(graph.edges().size(), true);
  std::mt19937 random(1);
  for (int k = 0; k < kLoops; ++k) {
    const bool wrong = k == 0 || k == 1 || k == 63 || k == 64 || k == 128 || k == kLoops - 1;
    const double x = static_cast<double>(random() % 100) - 50, y = 60 + 40 * k;
    AddLoop(graph, k, k + 200, wrong ? Eigen::Vector3d(x, y, 0) : Eigen::Vector3d::Zero());
    expected.push_back(!wrong);
  }
  EXPECT_EQ(Kept(graph), expected);
}

}  // namespace
}  // namespace tutti
