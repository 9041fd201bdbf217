#include "tutti/backend/pose_graph_optimizer.h"

#include <gtest/gtest.h>

#include "core/dense_solvers.h"
#include "tests/backend/graph/synthetic_graph.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::MakeSyntheticGraph;
using testing::PositionError;
using testing::SyntheticGraph;
using testing::SyntheticGraphOptions;

SyntheticGraphOptions NoisyGraphOptions(GraphKind kind) { return testing::NoisyOptions(kind, 0.02, 0.01); }

TEST(PoseGraphOptimizer, ReturnsToTheTruthFromPerturbedPosesForEveryKind) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    SyntheticGraphOptions options;
    options.kind = kind;
    SyntheticGraph synthetic = MakeSyntheticGraph(options);
    std::mt19937 random(4);
    for (int id = 1; id < options.nodes; ++id) {
      synthetic.graph.SetPose(id,
                              synthetic.graph.Node(id).pose * testing::RandomPose(kind, random, 0.3, 0.1));
    }
    PoseGraphOptions solver;
    solver.init = GraphInit::kFile;
    const PoseGraphReport report = PoseGraphOptimizer(solver).Optimize(synthetic.graph);
    EXPECT_TRUE(report.success) << report.reason;
    EXPECT_EQ(report.termination, "converged");
    EXPECT_LT(PositionError(synthetic.graph, synthetic.truth), 1e-5) << ToString(kind);
  }
}

TEST(PoseGraphOptimizer, LoopsRemoveTheDriftOfTheOdometry) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    SyntheticGraph synthetic = MakeSyntheticGraph(NoisyGraphOptions(kind));
    const double before = PositionError(synthetic.graph, synthetic.truth);
    const PoseGraphReport report = PoseGraphOptimizer().Optimize(synthetic.graph);
    EXPECT_TRUE(report.success);
    EXPECT_LE(report.objective, report.initial_objective);  // the start may be the optimum to all digits
    EXPECT_LT(PositionError(synthetic.graph, synthetic.truth), 0.7 * before) << ToString(kind);
  }
}

TEST(PoseGraphOptimizer, StopsWhenItIsAskedToAndThePosesStay) {
  for (const GraphKind kind : testing::kGraphKinds) {
    for (const PoseGraphSolver solver : {PoseGraphSolver::kCeres, PoseGraphSolver::kBlock}) {
      for (const GraphInit init : {GraphInit::kFile, GraphInit::kChordal}) {
        PoseGraph graph = MakeSyntheticGraph(NoisyGraphOptions(kind)).graph;
        const std::map<NodeId, Similarity> before = graph.Poses();
        PoseGraphOptions options;
        options.solver = solver;
        options.init = init;
        int asked = 0;
        const PoseGraphReport report =
            PoseGraphOptimizer(options).Optimize(graph, [&asked] { return ++asked == 2; });
        EXPECT_FALSE(report.success);
        EXPECT_EQ(report.termination, "stopped");
        EXPECT_EQ(report.reason, "stopped by the caller");
        EXPECT_EQ(asked, 2) << ToString(kind) << ToString(solver);
        for (const auto& [id, pose] : before)
          EXPECT_EQ(graph.Node(id).pose.translation, pose.translation) << ToString(kind) << ToString(solver);
      }
    }
  }
}

TEST(PoseGraphOptimizer, AskingWhetherToStopChangesNothing) {
  PoseGraph asked = MakeSyntheticGraph(NoisyGraphOptions(GraphKind::kSE3)).graph, plain = asked;
  PoseGraphOptimizer().Optimize(asked, [] { return false; });
  PoseGraphOptimizer().Optimize(plain);
  EXPECT_EQ(PositionError(asked, MakeSyntheticGraph(NoisyGraphOptions(GraphKind::kSE3)).truth),
            PositionError(plain, MakeSyntheticGraph(NoisyGraphOptions(GraphKind::kSE3)).truth));
}

TEST(PoseGraphOptimizer, TheChordalStartIsTriedAtItsRelaxationAndAtItsOptimum) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    PoseGraph graph = MakeSyntheticGraph(testing::NoisyOptions(kind, 0.02, 0.2)).graph;
    PoseGraphOptions options;
    options.init = GraphInit::kChordal;
    const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
    if (kind == GraphKind::kSim3) {  // no chordal objective with scale
      ASSERT_EQ(report.starts.size(), 1u);
      EXPECT_EQ(report.start, GraphStart::kChordalRelaxation);
      EXPECT_TRUE(report.chordal_optimum.empty());
      continue;
    }
    ASSERT_EQ(report.starts.size(), 2u) << ToString(kind);
    EXPECT_EQ(report.start, GraphStart::kChordalOptimum);
    EXPECT_FALSE(report.starts[0].spared);
    EXPECT_TRUE(report.starts[1].spared) << "downhill all the way to the same solution";
    EXPECT_EQ(report.starts[0].objective, report.objective);
    EXPECT_LT(report.starts[0].initial_objective, report.starts[1].initial_objective);
    EXPECT_EQ(report.chordal_optimum.size(), graph.nodes().size());
  }
}

TEST(PoseGraphOptimizer, TheRelaxationIsTheOnlyChordalStartWhereItLeavesSmallResiduals) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3}) {
    PoseGraph graph = MakeSyntheticGraph(NoisyGraphOptions(kind)).graph;
    PoseGraphOptions options;
    options.init = GraphInit::kChordal;
    PoseGraph certified = graph;
    const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
    ASSERT_EQ(report.starts.size(), 1u) << ToString(kind);
    EXPECT_EQ(report.start, GraphStart::kChordalRelaxation);
    EXPECT_TRUE(report.chordal_optimum.empty());
    options.will_certify = true;
    const PoseGraphReport other = PoseGraphOptimizer(options).Optimize(certified);
    EXPECT_FALSE(other.chordal_optimum.empty());
    EXPECT_NEAR(other.objective, report.objective, 1e-6 * report.objective);
  }
}

TEST(PoseGraphOptimizer, ARobustLossHasOneStart) {
  PoseGraph graph = MakeSyntheticGraph(NoisyGraphOptions(GraphKind::kSE3)).graph;
  PoseGraphOptions options;
  options.init = GraphInit::kChordal;
  options.robust = RobustLoss::kGnc;
  const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
  ASSERT_EQ(report.starts.size(), 1u);
  EXPECT_EQ(report.start, GraphStart::kChordalRelaxation);
}

TEST(PoseGraphOptimizer, SimilarityGraphRemovesScaleDrift) {
  // Odometry that shrinks by 1 % per step, and exact loops: after optimisation the scales of both rounds
  // agree.
  PoseGraph graph(GraphKind::kSim3);
  SyntheticGraphOptions options;
  options.kind = GraphKind::kSim3;
  const SyntheticGraph exact = MakeSyntheticGraph(options);
  Similarity pose = exact.truth[0];
  for (int k = 0; k < options.nodes; ++k) {
    const std::size_t n = static_cast<std::size_t>(k);
    Similarity step = k == 0 ? Similarity() : exact.truth[n - 1].Inverse() * exact.truth[n];
    if (k > 0) step.scale = 0.99;
    pose = pose * step;
    graph.AddNode(k, pose);
    step.scale = 1.0;
    if (k > 0) graph.AddOdometry(k - 1, k, step, MakeInformation(0.02, 0.01, 0.02));
  }
  for (const PoseGraphEdge& edge : exact.graph.edges()) {
    if (edge.kind == EdgeKind::kLoop) graph.AddEdge(edge);
  }
  EXPECT_LT(graph.Node(119).pose.scale, 0.35);
  EXPECT_TRUE(PoseGraphOptimizer().Optimize(graph).success);
  EXPECT_NEAR(graph.Node(119).pose.scale, 1.0, 1e-3);
  EXPECT_LT(PositionError(graph, exact.truth), 1e-2);
}

TEST(PoseGraphOptimizer, OffDiagonalInformationMovesTheOptimumToTheClosedForm) {
  // Two translations-only measurements of one node with full information: the optimum is (A + B)^-1 (A a + B
  // b).
  std::mt19937 random(11);
  PoseGraph graph;
  graph.AddNode(0, Pose(), true);
  graph.AddNode(1, Pose());
  Matrix7d A = Matrix7d::Identity() * 1e8, B = A;
  A.topLeftCorner<3, 3>() = testing::RandomInformation(random).topLeftCorner<3, 3>();
  B.topLeftCorner<3, 3>() = testing::RandomInformation(random).topLeftCorner<3, 3>();
  const Eigen::Vector3d a(1, 2, 3), b(-2, 0.5, 1);
  graph.AddLoop(0, 1, Similarity(1, Eigen::Quaterniond::Identity(), a), A);
  graph.AddLoop(0, 1, Similarity(1, Eigen::Quaterniond::Identity(), b), B);
  EXPECT_TRUE(PoseGraphOptimizer().Optimize(graph).success);
  const Eigen::Matrix3d A3 = A.topLeftCorner<3, 3>(), B3 = B.topLeftCorner<3, 3>();
  const Eigen::Vector3d expected = internal::SolveLdlt<3>(A3 + B3, A3 * a + B3 * b);
  EXPECT_LT((graph.Node(1).pose.translation - expected).norm(), 1e-6);
}

TEST(PoseGraphOptimizer, AnchorsDisconnectedPartsAndReportsThem) {
  PoseGraph graph;
  const Similarity step(1, Eigen::Quaterniond::Identity(), {1, 0, 0});
  for (int id : {0, 1, 2, 10, 11, 12, 99})
    graph.AddNode(id, Pose(Eigen::Quaterniond::Identity(), {0.9 * id, 0, 0}));
  for (int id : {0, 1, 10, 11}) graph.AddOdometry(id, id + 1, step, Matrix7d::Identity());
  const PoseGraphReport report = PoseGraphOptimizer().Optimize(graph);
  EXPECT_TRUE(report.success);
  ASSERT_EQ(report.components.size(), 3u);
  EXPECT_EQ(report.components[1].anchor, 10);
  EXPECT_EQ(report.components[1].nodes, 3u);
  EXPECT_NEAR(graph.Node(12).pose.translation.x(), 9.0 + 2.0, 1e-6);
  EXPECT_NEAR(graph.Node(99).pose.translation.x(), 0.9 * 99, 1e-12);
}

TEST(PoseGraphOptimizer, FixedNodesDoNotMove) {
  SyntheticGraph synthetic = MakeSyntheticGraph(NoisyGraphOptions(GraphKind::kSE3));
  synthetic.graph.SetFixed(30, true);
  synthetic.graph.SetFixed(50, true);
  const Similarity a = synthetic.graph.Node(30).pose, b = synthetic.graph.Node(50).pose,
                   free = synthetic.graph.Node(0).pose;
  EXPECT_TRUE(PoseGraphOptimizer().Optimize(synthetic.graph).success);
  EXPECT_EQ(synthetic.graph.Node(30).pose.translation, a.translation);
  EXPECT_EQ(synthetic.graph.Node(50).pose.rotation.coeffs(), b.rotation.coeffs());
  EXPECT_GT((synthetic.graph.Node(0).pose.translation - free.translation).norm(), 1e-9);
}

TEST(PoseGraphOptimizer, RobustLossesRejectPlantedFalseLoops) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    SyntheticGraphOptions options = NoisyGraphOptions(kind);
    SyntheticGraph clean = MakeSyntheticGraph(options);
    PoseGraphOptimizer().Optimize(clean.graph);
    options.false_loops = 20;
    for (RobustLoss robust : {RobustLoss::kCauchy, RobustLoss::kDcs, RobustLoss::kGnc}) {
      SyntheticGraph spoiled = MakeSyntheticGraph(options);
      PoseGraphOptions solver;
      solver.robust = robust;
      const PoseGraphReport report = PoseGraphOptimizer(solver).Optimize(spoiled.graph);
      ASSERT_TRUE(report.success);
      const double clean_error = PositionError(clean.graph, clean.truth);
      EXPECT_LT(PositionError(spoiled.graph, spoiled.truth), 1.3 * clean_error + 0.01)
          << ToString(kind) << " " << ToString(robust);
      for (std::size_t e : spoiled.false_edges) {
        EXPECT_TRUE(report.edges[e].down_weighted)
            << ToString(kind) << " " << ToString(robust) << " edge " << e;
      }
      EXPECT_LE(report.down_weighted, spoiled.false_edges.size() + 2);
    }
  }
}

TEST(PoseGraphOptimizer, AThresholdThatIsTooWideForTheGraphIsBroughtDown) {
  // Information that promises 100 times less than the loops keep: the false one hides below the 99 %
  // quantile.
  SyntheticGraphOptions options;
  options.noise_translation = 2e-4;
  options.noise_rotation = 1e-4;
  const SyntheticGraph exact = MakeSyntheticGraph(options);
  PoseGraph graph;
  for (const PoseGraphNode& node : exact.graph.nodes()) graph.AddNode(node);
  for (PoseGraphEdge edge : exact.graph.edges()) {
    edge.information = MakeInformation(0.2, 0.1);
    graph.AddEdge(edge);
  }
  graph.AddLoop(10, 70,
                exact.truth[10].Inverse() * exact.truth[70] *
                    Similarity(1, Eigen::Quaterniond::Identity(), {0, 0, 1.5}),
                MakeInformation(0.2, 0.1));
  PoseGraph unsuspecting = graph;
  PoseGraphOptions solver;
  solver.robust = RobustLoss::kGnc;
  EXPECT_TRUE(PoseGraphOptimizer(solver).Optimize(graph).edges.back().down_weighted);
  solver.robust_chi2 = 1000;
  EXPECT_FALSE(PoseGraphOptimizer(solver).Optimize(unsuspecting).edges.back().down_weighted);
}

TEST(PoseGraphOptimizer, HuberIsLessSpoiledByAWrongLoopThanLeastSquares) {
  const SyntheticGraph synthetic = MakeSyntheticGraph(NoisyGraphOptions(GraphKind::kSE3));
  PoseGraph clean = synthetic.graph, plain = synthetic.graph;
  const Similarity wrong = synthetic.truth[10].Inverse() * synthetic.truth[70] *
                           Similarity(1, Eigen::Quaterniond::Identity(), {0, 0, 2});
  plain.AddLoop(10, 70, wrong, MakeInformation(0.02, 0.01));
  PoseGraph robust = plain;
  PoseGraphOptions solver;
  PoseGraphOptimizer(solver).Optimize(clean);
  PoseGraphOptimizer(solver).Optimize(plain);
  solver.robust = RobustLoss::kHuber;
  const PoseGraphReport report = PoseGraphOptimizer(solver).Optimize(robust);
  const Eigen::Vector3d at = clean.Node(70).pose.translation;
  EXPECT_LT((robust.Node(70).pose.translation - at).norm(),
            0.3 * (plain.Node(70).pose.translation - at).norm());
  EXPECT_TRUE(report.edges.back().down_weighted);
}

TEST(PoseGraphOptimizer, RobustLossLeavesOdometryEdgesAlone) {
  PoseGraph graph;
  graph.AddNode(0, Pose());
  graph.AddNode(1, Pose(Eigen::Quaterniond::Identity(), {1, 0, 0}), true);
  graph.AddOdometry(0, 1, Similarity(1, Eigen::Quaterniond::Identity(), {100, 0, 0}), Matrix7d::Identity());
  PoseGraphOptions options;
  options.robust = RobustLoss::kGnc;
  const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
  EXPECT_EQ(report.edges[0].weight, 1.0);
  EXPECT_NEAR(graph.Node(0).pose.translation.x(), -99, 1e-6);
}

TEST(PoseGraphOptimizer, DuplicateEdgesCountTwice) {
  PoseGraph graph;
  graph.AddNode(0, Pose(), true);
  graph.AddNode(1, Pose());
  const auto at = [](double x) { return Similarity(1, Eigen::Quaterniond::Identity(), {x, 0, 0}); };
  graph.AddOdometry(0, 1, at(0), Matrix7d::Identity());
  graph.AddOdometry(0, 1, at(3), Matrix7d::Identity());
  graph.AddOdometry(0, 1, at(3), Matrix7d::Identity());
  EXPECT_TRUE(PoseGraphOptimizer().Optimize(graph).success);
  EXPECT_NEAR(graph.Node(1).pose.translation.x(), 2.0, 1e-6);
}

TEST(PoseGraphOptimizer, SameInputGivesTheSameBits) {
  SyntheticGraphOptions options = NoisyGraphOptions(GraphKind::kSim3);
  options.false_loops = 5;
  PoseGraphOptions solver;
  solver.robust = RobustLoss::kGnc;
  SyntheticGraph a = MakeSyntheticGraph(options), b = MakeSyntheticGraph(options);
  PoseGraphOptimizer(solver).Optimize(a.graph);
  PoseGraphOptimizer(solver).Optimize(b.graph);
  for (std::size_t k = 0; k < a.graph.nodes().size(); ++k) {
    EXPECT_EQ(a.graph.nodes()[k].pose.translation, b.graph.nodes()[k].pose.translation);
    EXPECT_EQ(a.graph.nodes()[k].pose.rotation.coeffs(), b.graph.nodes()[k].pose.rotation.coeffs());
  }
}

TEST(PoseGraphOptimizer, SaysWhyItCanNotStartFromPosesThatAreMissing) {
  PoseGraph graph;
  graph.AddNode(0, Pose());
  graph.AddNode(PoseGraphNode{4, Similarity(), false, false});
  graph.AddOdometry(0, 4, Similarity(), Matrix7d::Identity());
  PoseGraphOptions options;
  options.init = GraphInit::kFile;
  const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
  EXPECT_FALSE(report.success);
  EXPECT_NE(report.reason.find("node 4 has no pose"), std::string::npos);
}

TEST(PoseGraphOptimizer, EmptyGraphsAreNothingToDo) {
  PoseGraph graph;
  EXPECT_EQ(PoseGraphOptimizer().Optimize(graph).termination, "nothing to do");
  graph.AddNode(0, Pose());
  EXPECT_TRUE(PoseGraphOptimizer().Optimize(graph).success);
}

TEST(PoseGraphOptimizer, GraphsOfFixedNodesAloneAreLeftAlone) {
  PoseGraph graph;
  graph.AddNode(0, Pose(), true);
  graph.AddNode(1, Pose(), true);
  graph.AddOdometry(0, 1, Similarity(1, Eigen::Quaterniond::Identity(), {1, 0, 0}), Matrix7d::Identity());
  const PoseGraphReport report = PoseGraphOptimizer().Optimize(graph);
  EXPECT_TRUE(report.success) << report.reason;
  EXPECT_NEAR(report.costs.chi2, 1.0, 1e-12);
}

TEST(PoseGraphOptimizer, RefusesOptionsThatMakeNoSense) {
  PoseGraphOptions options;
  options.max_iterations = 0;
  EXPECT_THROW(PoseGraphOptimizer{options}, InputError);
  options = {};
  options.function_tolerance = 1.0;
  EXPECT_THROW(PoseGraphOptimizer{options}, InputError);
  EXPECT_THROW(ParseRobustLoss("hubber"), InputError);
  EXPECT_EQ(ParseGraphInit("chordal"), GraphInit::kChordal);
}

}  // namespace
}  // namespace tutti
