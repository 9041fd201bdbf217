#include "backend/robust/cluster_search.h"

#include <gtest/gtest.h>

#include <cmath>

#include "backend/graph/false_loops.h"
#include "backend/solver/graph_initialization.h"
#include "tests/backend/graph/synthetic_graph.h"
#include "tests/support/test_data.h"
#include "tutti/backend/g2o_io.h"

namespace tutti {
namespace {

bool GrowFromOdometry(const testing::ProblemAtPoses& made,
                      const std::vector<internal::LoopCluster>& clusters) {
  made.problem->SetPoses(internal::OdometryInitialization(made.graph, made.structure));
  const std::function<bool(int)> solve = [&](int iterations) {
    return made.problem->Solve(iterations, 0).usable;
  };
  return internal::GrowClusters(*made.problem, clusters, solve);
}

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
    const testing::ProblemAtPoses at(made.graph);
    grown = GrowFromOdometry(
        at, internal::ClusterLoops(at.graph, at.structure, at.options.objective, at.problem->threshold()));
    weights = at.problem->weights();
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
  EXPECT_FALSE(GrowFromOdometry(testing::ProblemAtPoses(graph), {{2, 3}}));
}

TEST(ClusterScore, IsTheChiSquareOfWhatIsInAndALogarithmForEachClusterThatIsOut) {
  PoseGraph graph;
  graph.AddNode(0, Pose(), true);
  graph.AddNode(1, Pose());
  const auto at = [](double x) { return Similarity(1, Eigen::Quaterniond::Identity(), {x, 0, 0}); };
  graph.AddOdometry(0, 1, at(2), Matrix7d::Identity());                          // chi-square 4
  for (int k = 0; k < 5; ++k) graph.AddLoop(0, 1, at(3), Matrix7d::Identity());  // 9 each
  const testing::ProblemAtPoses made(graph);
  internal::GraphProblem& problem = *made.problem;
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

struct Planted {
  PoseGraph graph;
  std::size_t first;  // position of the first false loop in edges()
};

/// The graph at its optimum, then false loops, then no poses: the odometry is where a robot starts from.
Planted PlantedIn(const std::filesystem::path& file, int count, int cluster_size, std::uint64_t seed) {
  PoseGraph clean = ReadG2o(file).graph;
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  options.solver = PoseGraphSolver::kBlock;
  PoseGraphOptimizer(options).Optimize(clean);
  FalseLoopOptions loops;
  loops.count = count;
  loops.cluster_size = cluster_size;
  loops.seed = seed;
  const std::size_t first = PlantFalseLoops(clean, loops).front();
  return {testing::WithoutPoses(clean), first};
}

PoseGraphReport Solve(PoseGraph& graph) {
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  options.solver = PoseGraphSolver::kBlock;
  options.robust = RobustLoss::kGnc;
  return PoseGraphOptimizer(options).Optimize(graph);
}

// Graduation alone keeps 26 of the false loops and drops two true ones.
TEST(ClusterSearch, FindsTheTruthWhereGraduationBelievesAFalseCluster) {
  TUTTI_REQUIRE_DATA(file, "posegraphs/intel.g2o");
  Planted planted = PlantedIn(file, 500, 20, 1);
  const PoseGraphReport report = Solve(planted.graph);
  ASSERT_TRUE(report.success) << report.reason;
  EXPECT_EQ(report.reason, "");
  EXPECT_EQ(report.termination, "converged");
  for (std::size_t e = 0; e < report.edges.size(); ++e)
    EXPECT_EQ(report.edges[e].down_weighted, e >= planted.first) << "edge " << e;
}

// Single loops that are rejected are no reason to search: the solution keeps its bits.
TEST(ClusterSearch, LeavesASolutionAloneThatRejectsSingleLoopsOnly) {
  TUTTI_REQUIRE_DATA(file, "posegraphs/intel.g2o");
  PoseGraphOptions options;
  options.robust = RobustLoss::kGnc;
  options.solver = PoseGraphSolver::kBlock;
  const testing::ProblemAtPoses made(PlantedIn(file, 20, 1, 1).graph, options);
  int solutions = 0;
  const auto solve = [&](int iterations) {
    ++solutions;
    return made.problem->Solve(iterations, 0).usable;
  };
  made.problem->SetPoses(internal::OdometryInitialization(made.graph, made.structure));
  internal::RobustSolver robust(*made.problem, made.options, solve);
  const std::size_t edges = made.graph.edges().size();
  for (std::size_t e = edges - 20; e < edges; ++e) made.problem->SetWeight(e, 0);
  EXPECT_FALSE(internal::SearchClusters(*made.problem, made.options, robust, solve));
  EXPECT_EQ(solutions, 0);
}

}  // namespace
}  // namespace tutti
