#include "backend/uncertainty/edge_prediction.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "backend/solver/weighted_graph.h"
#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

// A graph at its optimum without its last edge, which is off by a little.
PoseGraph WithNewcomer(GraphKind kind) {
  PoseGraph graph = testing::MakeSyntheticGraph(testing::NoisyOptions(kind, 0.02, 0.004)).graph;
  PoseGraphOptimizer().Optimize(graph);
  Similarity measured = graph.Node(17).pose.Inverse() * graph.Node(90).pose;
  measured.translation.x() += 0.1;
  graph.AddLoop(17, 90, measured, MakeInformation(0.02, 0.004, 0.004));
  return graph;
}

TEST(EdgePrediction, ChiSquareIsWhatTheCostRisesByWhenTheEdgeJoins) {
  for (const GraphKind kind : testing::kGraphKinds) {
    const PoseGraph graph = WithNewcomer(kind);
    const std::size_t last = graph.edges().size() - 1;
    const testing::ProblemAtPoses made(graph);
    made.problem->SetWeight(last, 0);
    const auto prediction = internal::MakeEdgePrediction(*made.problem);
    ASSERT_TRUE(prediction->Update());
    const internal::PredictedEdge predicted = prediction->Of(last);
    PoseGraph with = graph;
    const double chi2 = made.problem->EdgeChi2(last);
    const double rise =
        PoseGraphOptimizer().Optimize(with).costs.chi2log - (EvaluateCosts(graph).chi2log - chi2);
    EXPECT_NEAR(predicted.chi2, rise, 0.02 * rise) << ToString(kind);
    EXPECT_LT(predicted.chi2, chi2);
    EXPECT_EQ(prediction->Of(last).chi2, predicted.chi2) << "what one call leaves behind spoils the next";
  }
}

TEST(EdgePrediction, SpreadIsThatOfTheDenseCovariance) {
  const PoseGraph graph = WithNewcomer(GraphKind::kSE2);
  const std::size_t last = graph.edges().size() - 1;
  const testing::ProblemAtPoses made(graph);
  made.problem->SetWeight(last, 0);
  const auto prediction = internal::MakeEdgePrediction(*made.problem);
  ASSERT_TRUE(prediction->Update());
  int unknowns = 0;
  const std::vector<int> unknown = internal::NumberUnknowns(made.structure.constant, unknowns);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * unknowns, 3 * unknowns), J;
  for (std::size_t e = 0; e <= last; ++e) {
    const auto edge = static_cast<const internal::WeightedGraph<3>&>(*made.problem).Linearized(e);
    J = Eigen::MatrixXd::Zero(3, 3 * unknowns);
    const std::size_t ends[2] = {made.structure.ends[e].from, made.structure.ends[e].to};
    for (int a = 0; a < 2; ++a) {
      if (unknown[ends[a]] >= 0) J.middleCols(3 * unknown[ends[a]], 3) = edge.jacobian[a];
    }
    if (e < last) H += J.transpose() * J;
  }
  const Eigen::Matrix3d S = Eigen::Matrix3d::Identity() + J * testing::DenseInverse(H) * J.transpose();
  EXPECT_NEAR(prediction->Of(last).spread, std::log(S.determinant()), 1e-6);
}

TEST(EdgePrediction, HasNoAnswerWhereTheGraphFallsApart) {
  PoseGraph graph;
  for (int id = 0; id < 3; ++id) graph.AddNode(id, Pose(Eigen::Quaterniond::Identity(), {1.0 * id, 0, 0}));
  const Similarity step(1, Eigen::Quaterniond::Identity(), {1, 0, 0});
  graph.AddOdometry(0, 1, step, Matrix7d::Identity());
  graph.AddLoop(1, 2, step, Matrix7d::Identity());
  const testing::ProblemAtPoses made(graph);
  made.problem->SetWeight(1, 0);
  EXPECT_FALSE(internal::MakeEdgePrediction(*made.problem)->Update());
}

PoseGraph SolvedGraph(GraphKind kind) {
  PoseGraph graph = testing::MakeSyntheticGraph(testing::NoisyOptions(kind, 0.02, 0.004)).graph;
  PoseGraphOptimizer().Optimize(graph);
  return graph;
}

PoseGraph Without(const PoseGraph& graph, std::size_t left_out) {
  PoseGraph out(graph.kind());
  for (const PoseGraphNode& node : graph.nodes()) out.AddNode(node);
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    if (e != left_out) out.AddEdge(graph.edges()[e]);
  }
  return out;
}

TEST(LeaveOneOut, IsWhatTheCostFallsByWhenTheEdgeLeaves) {
  for (const GraphKind kind : testing::kGraphKinds) {
    const testing::ProblemAtPoses made(SolvedGraph(kind));
    std::vector<std::size_t> edges;
    for (std::size_t e = 119; e < made.graph.edges().size(); e += 9) edges.push_back(e);
    const std::vector<double> chi2 = internal::LeaveOneOutChi2(*made.problem, edges);
    ASSERT_EQ(chi2.size(), edges.size());
    const double all = EvaluateCosts(made.graph).chi2log;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      PoseGraph rest = Without(made.graph, edges[k]);
      const double fall = all - PoseGraphOptimizer().Optimize(rest).costs.chi2log;
      EXPECT_NEAR(chi2[k], fall, 0.03 * fall + 1e-3) << ToString(kind) << " edge " << edges[k];
      EXPECT_GT(chi2[k], made.problem->EdgeChi2(edges[k]));
    }
  }
}

TEST(LeaveOneOut, IsZeroForAnEdgeThatAloneHoldsItsEnds) {
  PoseGraph graph;
  std::mt19937 random(2);
  graph.AddNode(0, Similarity());
  Similarity pose;
  for (int id = 1; id < 4; ++id) {
    const Similarity step = testing::RandomPose(GraphKind::kSE3, random, 1, 1);
    pose = pose * step;
    graph.AddNode(id, pose);
    graph.AddLoop(id - 1, id, step, testing::RandomInformation(random));
  }
  const std::vector<double> chi2 =
      internal::LeaveOneOutChi2(*testing::ProblemAtPoses(graph).problem, {0, 1, 2});
  ASSERT_EQ(chi2.size(), 3u);
  for (const double one : chi2) EXPECT_LT(one, 1e-9);
}

}  // namespace
}  // namespace tutti
