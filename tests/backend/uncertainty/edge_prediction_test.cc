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

}  // namespace
}  // namespace tutti
