#include "backend/uncertainty/edge_prediction.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

using internal::EdgePrediction;
using internal::GraphProblem;
using internal::PredictedEdge;

// A graph at its optimum without its last edge, which is off by a little.
PoseGraph WithNewcomer(GraphKind kind) {
  PoseGraph graph = testing::MakeSyntheticGraph(testing::NoisyOptions(kind, 0.02, 0.004)).graph;
  PoseGraphOptimizer().Optimize(graph);
  Similarity measured = graph.Node(17).pose.Inverse() * graph.Node(90).pose;
  measured.translation.x() += 0.1;
  graph.AddLoop(17, 90, measured, MakeInformation(0.02, 0.004, 0.004));
  return graph;
}

template <int N>
GraphProblem<N> ProblemAt(const PoseGraph& graph, const internal::GraphStructure& structure,
                          const PoseGraphOptions& options) {
  GraphProblem<N> problem(graph, structure, options);
  std::vector<Similarity> poses;
  for (const PoseGraphNode& node : graph.nodes()) poses.push_back(node.pose);
  problem.SetPoses(poses);
  problem.SetWeight(graph.edges().size() - 1, 0);
  return problem;
}

template <int N>
void ExpectTheRiseOfTheCost(GraphKind kind) {
  const PoseGraph graph = WithNewcomer(kind);
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  const PoseGraphOptions options;
  const std::size_t last = graph.edges().size() - 1;
  const GraphProblem<N> problem = ProblemAt<N>(graph, structure, options);
  EdgePrediction<N> prediction(problem);
  ASSERT_TRUE(prediction.Update());
  const PredictedEdge predicted = prediction.Of(last);
  PoseGraph with = graph;
  const double rise = PoseGraphOptimizer().Optimize(with).costs.chi2log -
                      (EvaluateCosts(graph).chi2log - problem.EdgeChi2(last));
  EXPECT_NEAR(predicted.chi2, rise, 0.02 * rise) << ToString(kind);
  EXPECT_LT(predicted.chi2, problem.EdgeChi2(last));
  EXPECT_EQ(prediction.Of(last).chi2, predicted.chi2) << "what one call leaves behind spoils the next";
}

TEST(EdgePrediction, ChiSquareIsWhatTheCostRisesByWhenTheEdgeJoins) {
  ExpectTheRiseOfTheCost<3>(GraphKind::kSE2);
  ExpectTheRiseOfTheCost<6>(GraphKind::kSE3);
  ExpectTheRiseOfTheCost<7>(GraphKind::kSim3);
}

TEST(EdgePrediction, SpreadIsThatOfTheDenseCovariance) {
  const PoseGraph graph = WithNewcomer(GraphKind::kSE2);
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  const PoseGraphOptions options;
  const std::size_t last = graph.edges().size() - 1;
  const GraphProblem<3> problem = ProblemAt<3>(graph, structure, options);
  EdgePrediction<3> prediction(problem);
  ASSERT_TRUE(prediction.Update());
  int size = 0;
  const std::vector<int> row = internal::NumberRows<3>(structure.constant, size);
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size), J;
  for (std::size_t e = 0; e <= last; ++e) {
    const internal::LinearizedEdge<3> edge = problem.Linearized(e);
    J = Eigen::MatrixXd::Zero(3, size);
    const std::size_t ends[2] = {structure.ends[e].from, structure.ends[e].to};
    for (int a = 0; a < 2; ++a) {
      if (row[ends[a]] >= 0) J.middleCols(row[ends[a]], 3) = edge.jacobian[a];
    }
    if (e < last) H += J.transpose() * J;
  }
  const Eigen::Matrix3d S = Eigen::Matrix3d::Identity() + J * testing::DenseInverse(H) * J.transpose();
  EXPECT_NEAR(prediction.Of(last).spread, std::log(S.determinant()), 1e-6);
}

TEST(EdgePrediction, HasNoAnswerWhereTheGraphFallsApart) {
  PoseGraph graph;
  for (int id = 0; id < 3; ++id) graph.AddNode(id, Pose(Eigen::Quaterniond::Identity(), {1.0 * id, 0, 0}));
  const Similarity step(1, Eigen::Quaterniond::Identity(), {1, 0, 0});
  graph.AddOdometry(0, 1, step, Matrix7d::Identity());
  graph.AddLoop(1, 2, step, Matrix7d::Identity());
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  const PoseGraphOptions options;
  const GraphProblem<6> problem = ProblemAt<6>(graph, structure, options);
  EXPECT_FALSE(EdgePrediction<6>(problem).Update());
}

}  // namespace
}  // namespace tutti
