#include "backend/robust/cluster_search.h"

#include <gtest/gtest.h>

#include "backend/graph/false_loops.h"
#include "tests/support/test_data.h"
#include "tutti/backend/g2o_io.h"

namespace tutti {
namespace {

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
  PoseGraph start(clean.kind());
  for (PoseGraphNode node : clean.nodes()) {
    node.has_estimate = false;
    start.AddNode(node);
  }
  for (const PoseGraphEdge& edge : clean.edges()) start.AddEdge(edge);
  return {start, first};
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
  const PoseGraph graph = PlantedIn(file, 20, 1, 1).graph;
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  PoseGraphOptions options;
  options.robust = RobustLoss::kGnc;
  options.solver = PoseGraphSolver::kBlock;
  int solutions = 0;
  internal::GraphProblem<3> problem(graph, structure, options);
  const auto solve = [&](int iterations) {
    ++solutions;
    return problem.Solve(iterations, 0).usable;
  };
  problem.SetPoses(internal::OdometryInitialization(graph, structure));
  internal::RobustSolver<3> robust(problem, options, graph.edges().size(), solve);
  for (std::size_t e = graph.edges().size() - 20; e < graph.edges().size(); ++e) problem.SetWeight(e, 0);
  EXPECT_FALSE(internal::ClusterSearch<3>(graph, options, problem, robust, solve).Improve());
  EXPECT_EQ(solutions, 0);
}

}  // namespace
}  // namespace tutti
