#include "backend/solver/graph_initialization.h"

#include <gtest/gtest.h>

#include "backend/solver/chordal_descent.h"
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

// Turn about the vertical [rad].
Similarity Turned(double heading, double scale, const Eigen::Vector3d& translation) {
  return Similarity(scale, ExpSO3({0, 0, heading}), translation);
}

// Rotations are drawn towards the mean of the matrices, scales to that of their logarithms, each by its
// weight; whichever way an edge points.
TEST(GraphInitialization, TwoEdgesThatContradictEachOtherMeetByTheirWeights) {
  constexpr double kFirst = 0.3, kSecond = 1.1, kScaleFirst = 1.2, kScaleSecond = 0.7;
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    const bool scaled = kind == GraphKind::kSim3;
    for (const bool backwards : {false, true}) {
      PoseGraph graph(kind);
      for (int id : {0, 1}) graph.AddNode(PoseGraphNode{id, Similarity(), id == 0, true});
      graph.AddOdometry(0, 1, Turned(kFirst, scaled ? kScaleFirst : 1, {1, 0, 0}), 3 * Matrix7d::Identity());
      const Similarity second = Turned(kSecond, scaled ? kScaleSecond : 1, {1, 0, 0});
      graph.AddLoop(backwards ? 1 : 0, backwards ? 0 : 1, backwards ? second.Inverse() : second,
                    2 * Matrix7d::Identity());
      std::string reason;
      const auto poses = internal::ChordalInitialization(graph, internal::AnalyseGraph(graph), reason);
      ASSERT_EQ(poses.size(), 2u) << reason;
      const double heading = std::atan2(3 * std::sin(kFirst) + 2 * std::sin(kSecond),
                                        3 * std::cos(kFirst) + 2 * std::cos(kSecond));
      EXPECT_NEAR(LogSO3(poses[1].rotation).z(), heading, 1e-9) << ToString(kind);
      const double log_scale = (3 * std::log(kScaleFirst) + 2 * std::log(kScaleSecond)) / 5;
      EXPECT_NEAR(std::log(poses[1].scale), scaled ? log_scale : 0, 1e-9);
    }
  }
}

// What the edges leave of the translations, each by its weight and in the unit of the node that it comes
// from.
double TranslationCost(const PoseGraph& graph, const internal::GraphStructure& structure,
                       const std::vector<Similarity>& poses) {
  double cost = 0;
  for (std::size_t e = 0; e < graph.edges().size(); ++e) {
    const PoseGraphEdge& edge = graph.edges()[e];
    const Similarity &i = poses[structure.ends[e].from], &j = poses[structure.ends[e].to];
    cost += internal::MakeChordalWeights(edge, graph.kind()).translation *
            (i.Inverse() * j.translation - edge.measurement.translation).squaredNorm();
  }
  return cost;
}

TEST(GraphInitialization, NoPositionCanMoveAndLowerTheCost) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3, GraphKind::kSim3}) {
    testing::SyntheticGraphOptions options = testing::NoisyOptions(kind, 0.05, 0.03);
    if (kind == GraphKind::kSim3) options.noise_log_scale = 0.02;
    const PoseGraph graph = testing::MakeSyntheticGraph(options).graph;
    const internal::GraphStructure structure = internal::AnalyseGraph(graph);
    std::string reason;
    const std::vector<Similarity> poses = internal::ChordalInitialization(graph, structure, reason);
    const double least = TranslationCost(graph, structure, poses);
    for (std::size_t k = 1; k < poses.size(); k += 13) {
      for (const double step : {-1e-3, 1e-3}) {
        for (int axis = 0; axis < (kind == GraphKind::kSE2 ? 2 : 3); ++axis) {
          std::vector<Similarity> moved = poses;
          moved[k].translation[axis] += step;
          EXPECT_GT(TranslationCost(graph, structure, moved), least) << ToString(kind) << " node " << k;
        }
      }
    }
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
