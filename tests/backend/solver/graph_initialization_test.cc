#include "backend/solver/graph_initialization.h"

#include <gtest/gtest.h>

#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

double MaxPositionError(const std::vector<Similarity>& poses, const std::vector<Similarity>& truth) {
  double worst = 0;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    worst = std::max(worst, (poses[k].translation - truth[k].translation).norm());
  }
  return worst;
}

TEST(GraphStructure, AnchorsEachPartAtItsFixedNodeOrSmallestId) {
  PoseGraph graph;
  for (int id : {5, 2, 9, 8, 4}) graph.AddNode(id, Pose(), id == 9);
  graph.AddOdometry(5, 2, Similarity(), Matrix7d::Identity());
  graph.AddOdometry(8, 9, Similarity(), Matrix7d::Identity());
  const internal::GraphStructure structure = internal::AnalyseGraph(graph);
  ASSERT_EQ(structure.components.size(), 3u);
  EXPECT_EQ(structure.components[0].anchor, 2);
  EXPECT_EQ(structure.components[0].nodes, 2u);
  EXPECT_EQ(structure.components[1].anchor, 9);
  EXPECT_EQ(structure.components[2].anchor, 4);
  EXPECT_EQ(structure.constant, (std::vector<bool>{false, true, true, false, true}));
}

TEST(GraphInitialization, ChordalIsExactWithoutNoiseForEveryKind) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    testing::SyntheticGraphOptions options;
    options.kind = kind;
    const testing::SyntheticGraph synthetic = testing::MakeSyntheticGraph(options);
    const internal::GraphStructure structure = internal::AnalyseGraph(synthetic.graph);
    std::string reason;
    const std::vector<Similarity> poses = internal::ChordalInitialization(synthetic.graph, structure, reason);
    EXPECT_EQ(reason, "");
    ASSERT_EQ(poses.size(), synthetic.truth.size());
    EXPECT_LT(MaxPositionError(poses, synthetic.truth), 1e-6) << ToString(kind);
  }
}

TEST(GraphInitialization, ChordalBeatsOdometryUnderNoise) {
  testing::SyntheticGraphOptions options;
  options.nodes = 400;
  options.loops = 150;
  options.noise_translation = 0.02;
  options.noise_rotation = 0.05;
  const testing::SyntheticGraph synthetic = testing::MakeSyntheticGraph(options);
  const internal::GraphStructure structure = internal::AnalyseGraph(synthetic.graph);
  std::string reason;
  EXPECT_LT(
      MaxPositionError(internal::ChordalInitialization(synthetic.graph, structure, reason), synthetic.truth),
      0.5 * MaxPositionError(internal::OdometryInitialization(synthetic.graph, structure), synthetic.truth));
}

TEST(GraphInitialization, OdometryUsesLoopsOnlyWhereNothingElseLeads) {
  PoseGraph graph;
  for (int id = 0; id < 4; ++id) graph.AddNode(PoseGraphNode{id, Similarity(), false, false});
  const Similarity step(1, Eigen::Quaterniond::Identity(), {1, 0, 0});
  const Similarity wrong(1, Eigen::Quaterniond::Identity(), {0, 50, 0});
  graph.AddLoop(0, 2, wrong, Matrix7d::Identity());
  graph.AddOdometry(0, 1, step, Matrix7d::Identity());
  graph.AddOdometry(2, 1, step.Inverse(), Matrix7d::Identity());  // backwards on purpose
  graph.AddLoop(3, 2, step.Inverse(), Matrix7d::Identity());
  const auto poses = internal::OdometryInitialization(graph, internal::AnalyseGraph(graph));
  for (int id = 0; id < 4; ++id) {
    EXPECT_LT((poses[static_cast<std::size_t>(id)].translation - Eigen::Vector3d(id, 0, 0)).norm(), 1e-12)
        << id;
  }
}

TEST(GraphInitialization, FixedNodesKeepTheirPoses) {
  testing::SyntheticGraphOptions options;
  testing::SyntheticGraph synthetic = testing::MakeSyntheticGraph(options);
  synthetic.graph.SetFixed(17, true);
  synthetic.graph.SetFixed(80, true);
  std::string reason;
  const auto poses =
      internal::ChordalInitialization(synthetic.graph, internal::AnalyseGraph(synthetic.graph), reason);
  for (int id : {17, 80}) {
    EXPECT_EQ(poses[static_cast<std::size_t>(id)].translation, synthetic.graph.Node(id).pose.translation);
  }
}

}  // namespace
}  // namespace tutti
