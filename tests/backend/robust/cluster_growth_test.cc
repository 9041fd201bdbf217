#include "backend/robust/cluster_growth.h"

#include <gtest/gtest.h>

#include "backend/graph/false_loops.h"
#include "backend/solver/graph_initialization.h"
#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

using internal::LoopCluster;

/// Two rounds of a circle with 10 places seen again and a cluster of 20 false loops; `weights` after growth.
struct Growth {
  bool grown = false;
  std::vector<double> weights;
  std::vector<std::size_t> planted;

  explicit Growth(GraphKind kind) {
    testing::SyntheticGraphOptions synthetic = testing::NoisyOptions(kind, 0.02, 0.004);
    synthetic.loops = 10;
    testing::SyntheticGraph made = testing::MakeSyntheticGraph(synthetic);
    for (std::size_t k = 0; k < made.truth.size(); ++k)
      made.graph.SetPose(static_cast<int>(k), made.truth[k]);
    FalseLoopOptions options;
    options.count = options.cluster_size = 20;
    planted = PlantFalseLoops(made.graph, options);
    const PoseGraph& graph = made.graph;
    if (kind == GraphKind::kSE2) Grow<3>(graph);
    if (kind == GraphKind::kSE3) Grow<6>(graph);
    if (kind == GraphKind::kSim3) Grow<7>(graph);
  }

  template <int N>
  void Grow(const PoseGraph& graph) {
    const internal::GraphStructure structure = internal::AnalyseGraph(graph);
    const PoseGraphOptions options;
    internal::GraphProblem<N> problem(graph, structure, options);
    problem.SetPoses(internal::OdometryInitialization(graph, structure));
    const std::vector<LoopCluster> clusters =
        internal::ClusterLoops(graph, structure, options.objective, problem.threshold());
    const std::function<bool(int)> solve = [&](int iterations) {
      return problem.Solve(iterations, 0).usable;
    };
    grown = internal::ClusterGrowth<N>(problem, clusters, solve).Grow();
    weights = problem.weights();
  }
};

TEST(ClusterGrowth, TakesInWhatTheGraphIsCertainOfAndLeavesALargerFalseClusterOut) {
  for (const GraphKind kind : testing::kGraphKinds) {
    const Growth growth(kind);
    ASSERT_TRUE(growth.grown);
    for (std::size_t e = 0; e < growth.weights.size(); ++e) {
      EXPECT_EQ(growth.weights[e], e < growth.planted.front() ? 1.0 : 0.0) << ToString(kind) << " edge " << e;
    }
  }
}

TEST(ClusterGrowth, NeedsOdometryThatHoldsTheGraphTogether) {
  PoseGraph graph;
  const Similarity step(1, Eigen::Quaterniond::Identity(), {1, 0, 0});
  for (int id = 0; id < 4; ++id) graph.AddNode(id, Pose(Eigen::Quaterniond::Identity(), {1.0 * id, 0, 0}));
  graph.AddOdometry(0, 1, step, Matrix7d::Identity());
  graph.AddOdometry(2, 3, step, Matrix7d::Identity());
  graph.AddLoop(1, 2, step, Matrix7d::Identity());
  graph.AddLoop(0, 3, step * step * step, Matrix7d::Identity());
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  const PoseGraphOptions options;
  internal::GraphProblem<6> problem(graph, structure, options);
  problem.SetPoses(internal::OdometryInitialization(graph, structure));
  const std::vector<LoopCluster> clusters = {{2, 3}};
  const std::function<bool(int)> solve = [&](int iterations) { return problem.Solve(iterations, 0).usable; };
  EXPECT_FALSE(internal::ClusterGrowth<6>(problem, clusters, solve).Grow());
}

}  // namespace
}  // namespace tutti
