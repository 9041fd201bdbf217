// Ceres and the block solver are two ways to the same optimum.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "backend/solver/graph_problem.h"
#include "tests/backend/graph/synthetic_graph.h"
#include "tests/support/test_data.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

using testing::MakeSyntheticGraph;
using testing::SyntheticGraphOptions;

struct Solved {
  PoseGraph graph;
  PoseGraphReport report;
};

Solved SolveWith(PoseGraphSolver solver, const PoseGraph& graph, PoseGraphOptions options) {
  Solved out{graph, {}};
  options.solver = solver;
  out.report = PoseGraphOptimizer(options).Optimize(out.graph);
  return out;
}

double LargestDistance(const PoseGraph& a, const PoseGraph& b) {
  double largest = 0;
  for (const PoseGraphNode& node : a.nodes())
    largest = std::max(largest, (node.pose.translation - b.Node(node.id).pose.translation).norm());
  return largest;
}

void ExpectTheSameOptimum(const PoseGraph& graph, const PoseGraphOptions& options, const std::string& what) {
  const Solved ceres = SolveWith(PoseGraphSolver::kCeres, graph, options);
  const Solved block = SolveWith(PoseGraphSolver::kBlock, graph, options);
  ASSERT_TRUE(ceres.report.success) << what << ": " << ceres.report.reason;
  ASSERT_TRUE(block.report.success) << what << ": " << block.report.reason;
  EXPECT_EQ(ceres.report.termination, block.report.termination) << what;
  EXPECT_EQ(ceres.report.start, block.report.start) << what;
  EXPECT_NEAR(block.report.objective, ceres.report.objective, 1e-9 * ceres.report.objective) << what;
  EXPECT_EQ(block.report.down_weighted, ceres.report.down_weighted) << what;
  EXPECT_EQ(ceres.report.solver, PoseGraphSolver::kCeres);
  EXPECT_EQ(block.report.solver, PoseGraphSolver::kBlock);
}

SyntheticGraphOptions NoisyWithFalseLoops(GraphKind kind) {
  SyntheticGraphOptions options = testing::NoisyOptions(kind, 0.02, 0.01);
  options.false_loops = 4;
  return options;
}

PoseGraphOptions Precise() {
  PoseGraphOptions options;
  options.function_tolerance = 1e-12;
  return options;
}

TEST(GraphSolvers, ReachTheSameOptimumForEveryKindAndLoss) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    const PoseGraph graph = MakeSyntheticGraph(NoisyWithFalseLoops(kind)).graph;
    for (RobustLoss robust :
         {RobustLoss::kNone, RobustLoss::kHuber, RobustLoss::kCauchy, RobustLoss::kDcs, RobustLoss::kGnc}) {
      PoseGraphOptions options = Precise();
      options.robust = robust;
      ExpectTheSameOptimum(graph, options, std::string(ToString(kind)) + " " + ToString(robust));
    }
  }
}

TEST(GraphSolvers, ReachTheSameOptimumOfBothObjectivesWithFixedNodes) {
  PoseGraph graph = MakeSyntheticGraph(NoisyWithFalseLoops(GraphKind::kSE3)).graph;
  graph.SetFixed(30, true);
  graph.SetFixed(50, true);
  for (GraphObjective objective : {GraphObjective::kChi2, GraphObjective::kChi2Log}) {
    PoseGraphOptions options = Precise();
    options.objective = objective;
    options.robust = RobustLoss::kHuber;
    ExpectTheSameOptimum(graph, options, ToString(objective));
  }
}

TEST(GraphSolvers, AgreeOnPartsThatNothingConnects) {
  PoseGraph graph = MakeSyntheticGraph(NoisyWithFalseLoops(GraphKind::kSE3)).graph;
  for (int id : {1000, 1001, 1002}) graph.AddNode(id, Pose(Eigen::Quaterniond::Identity(), {0.9 * id, 0, 0}));
  const Similarity step(1, Eigen::Quaterniond::Identity(), {1, 0, 0});
  graph.AddOdometry(1000, 1001, step, Matrix7d::Identity());
  const Solved ceres = SolveWith(PoseGraphSolver::kCeres, graph, Precise());
  const Solved block = SolveWith(PoseGraphSolver::kBlock, graph, Precise());
  EXPECT_EQ(block.report.termination, "converged");
  EXPECT_EQ(block.report.components.size(), 3u);
  EXPECT_LT(LargestDistance(ceres.graph, block.graph), 1e-4);  // flat: 1e-12 of the cost
  EXPECT_EQ(block.graph.Node(1002).pose.translation, graph.Node(1002).pose.translation);
}

// Two loops that contradict each other are all that holds the two parts together. Without them the second
// part hangs in the air, and the normal equations are singular.
TEST(GraphSolvers, AgreeOnAPartThatOnlyRefusedLoopsTie) {
  PoseGraph graph;
  const Similarity step(1, Eigen::Quaterniond::Identity(), {1, 0, 0});
  for (int id = 0; id < 8; ++id) graph.AddNode(id, Pose(Eigen::Quaterniond::Identity(), {1.1 * id, 0, 0}));
  for (int id : {0, 1, 2, 4, 5, 6}) graph.AddOdometry(id, id + 1, step, 100 * Matrix7d::Identity());
  const Matrix7d sure = 1e4 * Matrix7d::Identity();
  graph.AddLoop(0, 3, Similarity(1, Eigen::Quaterniond::Identity(), {3, 0, 0}), sure);
  graph.AddLoop(1, 5, Similarity(1, Eigen::Quaterniond::Identity(), {50, 0, 0}), sure);
  graph.AddLoop(1, 5, Similarity(1, Eigen::Quaterniond::Identity(), {-50, 0, 0}), sure);
  for (PoseGraphSolver solver : {PoseGraphSolver::kCeres, PoseGraphSolver::kBlock}) {
    PoseGraphOptions options = Precise();
    options.solver = solver;
    const testing::ProblemAtPoses made(graph, options);
    for (const std::size_t refused : {7u, 8u}) made.problem->SetWeight(refused, 0);
    EXPECT_TRUE(made.problem->Solve(options.max_iterations, 0).usable) << ToString(solver);
    const std::vector<Similarity> poses = made.problem->Poses();
    EXPECT_NEAR(poses[3].translation.x(), 3, 1e-6) << ToString(solver);
    EXPECT_NEAR((poses[7].translation - poses[4].translation).norm(), 3, 1e-4) << ToString(solver);
  }
}

TEST(GraphSolvers, FailOnTheSameGraphsAndLeaveThemAlone) {
  const PoseGraph graph = testing::OverflowingGraph();
  PoseGraphOptions options;
  options.init = GraphInit::kFile;
  for (PoseGraphSolver solver : {PoseGraphSolver::kCeres, PoseGraphSolver::kBlock}) {
    const Solved solved = SolveWith(solver, graph, options);
    EXPECT_FALSE(solved.report.success) << ToString(solver);
    EXPECT_NE(solved.report.reason, "");
    EXPECT_EQ(LargestDistance(solved.graph, graph), 0);
  }
}

TEST(GraphSolvers, StopAtTheIterationLimit) {
  SyntheticGraphOptions synthetic = NoisyWithFalseLoops(GraphKind::kSE3);
  synthetic.false_loops = 0;
  const PoseGraph graph = MakeSyntheticGraph(synthetic).graph;
  PoseGraphOptions options = Precise();
  options.max_iterations = 1;
  for (PoseGraphSolver solver : {PoseGraphSolver::kCeres, PoseGraphSolver::kBlock}) {
    const Solved solved = SolveWith(solver, graph, options);
    EXPECT_TRUE(solved.report.success);
    EXPECT_EQ(solved.report.termination, "iteration limit") << ToString(solver);
    EXPECT_LT(solved.report.objective, solved.report.initial_objective);
  }
}

class BothSolvers : public ::testing::TestWithParam<const char*> {};

TEST_P(BothSolvers, ReachTheSameOptimumOfAPublishedGraph) {
  TUTTI_REQUIRE_DATA(folder, "posegraphs");
  const PoseGraph graph = ReadG2o(folder / (std::string(GetParam()) + ".g2o")).graph;
  PoseGraphOptions options = Precise();
  options.objective = GraphObjective::kChi2;
  options.init = GraphInit::kChordal;
  ExpectTheSameOptimum(graph, options, GetParam());
}

INSTANTIATE_TEST_SUITE_P(Published, BothSolvers,
                         ::testing::Values("sphere2500", "parking-garage", "intel", "manhattanOlson3500",
                                           "kitti_00", "manhattan", "torus3D"),
                         [](const auto& test) { return testing::TestName(test.param); });

}  // namespace
}  // namespace tutti
