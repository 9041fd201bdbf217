#include "tutti/backend/graph_covariance.h"

#include <gtest/gtest.h>

#include "tests/backend/graph/synthetic_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using testing::MakeSyntheticGraph;
using testing::SyntheticGraph;
using testing::SyntheticGraphOptions;

TEST(GraphCovariance, GrowsAlongAChainAsTheSumOfItsEdges) {
  PoseGraph graph;
  for (int id = 0; id <= 4; ++id) graph.AddNode(id, Pose(Eigen::Quaterniond::Identity(), {1.0 * id, 0, 0}));
  for (int id = 0; id < 4; ++id)
    graph.AddOdometry(id, id + 1, Similarity(1, Eigen::Quaterniond::Identity(), {1, 0, 0}),
                      MakeInformation(0.1, 0.02));
  const GraphCovariance covariance(graph);
  EXPECT_TRUE(covariance.OfPose(0).isZero());
  const Eigen::MatrixXd end = covariance.OfPose(4);
  EXPECT_NEAR(end(0, 0), 4 * 0.01, 1e-12);                         // along the way: translations alone
  EXPECT_NEAR(end(1, 1), 4 * 0.01 + (9 + 4 + 1) * 0.0004, 1e-12);  // across: the headings' levers too
  EXPECT_NEAR(end(5, 5), 4 * 0.0004, 1e-12);
  EXPECT_NEAR(covariance.OfRelativePose(1, 3)(0, 0), 2 * 0.01, 1e-12);  // whatever came before
}

TEST(GraphCovariance, IsTheInverseOfTheEdgeInformationForOneEdgeOfEveryKind) {
  std::mt19937 random(5);
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    PoseGraph graph(kind);
    const Similarity step = testing::RandomPose(kind, random, 2.0, 1.0);
    graph.AddNode(0, Similarity());
    graph.AddNode(1, step);
    const Matrix7d information = testing::RandomInformation(random);
    graph.AddOdometry(0, 1, step, information);
    const std::vector<int> used = TangentCoordinates(kind);
    const Eigen::MatrixXd expected = testing::DenseInverse(information(used, used));
    EXPECT_TRUE(GraphCovariance(graph).OfRelativePose(0, 1).isApprox(expected, 1e-9)) << ToString(kind);
  }
}

TEST(GraphCovariance, LoopsShrinkIt) {
  SyntheticGraphOptions options;
  options.loops = 0;
  const SyntheticGraph open = MakeSyntheticGraph(options);
  options.loops = 10;
  const SyntheticGraph closed = MakeSyntheticGraph(options);
  EXPECT_LT(GraphCovariance(closed.graph).OfPose(119).trace(),
            0.5 * GraphCovariance(open.graph).OfPose(119).trace());
}

TEST(GraphCovariance, DistanceIsWhatALoopAddsToTheCost) {
  SyntheticGraphOptions options;
  options.noise_translation = 0.01;
  options.noise_rotation = 0.002;
  options.loops = 5;
  SyntheticGraph synthetic = MakeSyntheticGraph(options);
  const double before = PoseGraphOptimizer().Optimize(synthetic.graph).objective;
  const PoseGraphEdge loop{20, 100, synthetic.truth[20].Inverse() * synthetic.truth[100],
                           MakeInformation(0.01, 0.002), EdgeKind::kLoop};
  const double distance = GraphCovariance(synthetic.graph).SquaredDistance(loop);
  synthetic.graph.AddEdge(loop);
  const double after = PoseGraphOptimizer().Optimize(synthetic.graph).objective;
  EXPECT_NEAR(distance, after - before, 0.1 * distance + 0.05);
}

TEST(GraphCovariance, SaysWhatItCanNotKnow) {
  PoseGraph graph;
  for (int id = 0; id < 4; ++id) graph.AddNode(id, Pose());
  graph.AddOdometry(0, 1, Similarity(), Matrix7d::Identity());
  graph.AddOdometry(2, 3, Similarity(), Matrix7d::Identity());
  const GraphCovariance covariance(graph);
  EXPECT_TRUE(covariance.Connected(0, 1));
  EXPECT_FALSE(covariance.Connected(1, 2));
  EXPECT_THROW(covariance.OfRelativePose(1, 2), InputError);
  EXPECT_THROW(covariance.OfPose(17), InputError);
}

}  // namespace
}  // namespace tutti
