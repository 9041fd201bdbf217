#include "tutti/backend/keyframe_graph.h"

#include <gtest/gtest.h>

#include "tests/backend/graph/synthetic_graph.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

testing::SyntheticGraph Drifting(GraphKind kind, int nodes = 200) {
  testing::SyntheticGraphOptions options;
  options.kind = kind;
  options.nodes = nodes;
  options.noise_translation = 0.01;
  options.noise_rotation = 0.004;
  options.noise_log_scale = kind == GraphKind::kSim3 ? 0.005 : 0;
  return testing::MakeSyntheticGraph(options);
}

KeyframeGraph FromOdometry(const testing::SyntheticGraph& synthetic, GraphKind kind) {
  KeyframeGraphOptions options;
  options.kind = kind;
  KeyframeGraph graph(options);
  for (const PoseGraphNode& node : synthetic.graph.nodes()) graph.AddKeyframe(node.id, node.pose);
  return graph;
}

Matrix6d LoopInformation() { return MakeInformation(0.02, 0.01).topLeftCorner<6, 6>(); }

double Error(const KeyframeCorrection& correction, const std::vector<Similarity>& truth) {
  double worst = 0;
  for (const auto& [id, pose] : correction.S_world_keyframe) {
    worst = std::max(worst, (pose.translation - truth[static_cast<std::size_t>(id)].translation).norm());
  }
  return worst;
}

TEST(KeyframeGraph, WithoutLoopsEveryKeyframeStaysWhereItIs) {
  const auto synthetic = Drifting(GraphKind::kSE3);
  const KeyframeCorrection correction = FromOdometry(synthetic, GraphKind::kSE3).Optimize();
  EXPECT_TRUE(correction.success);
  for (const PoseGraphNode& node : synthetic.graph.nodes()) {
    EXPECT_LT((correction.S_world_keyframe.at(node.id).translation - node.pose.translation).norm(), 1e-9);
  }
}

TEST(KeyframeGraph, ATrueLoopPullsTheTrajectoryTogether) {
  for (GraphKind kind : {GraphKind::kSE3, GraphKind::kSim3}) {
    const auto synthetic = Drifting(kind);
    KeyframeGraph graph = FromOdometry(synthetic, kind);
    const double before = Error(graph.Optimize(), synthetic.truth);
    graph.AddLoop(5, 105, synthetic.truth[5].Inverse() * synthetic.truth[105], LoopInformation());
    graph.AddLoop(90, 190, synthetic.truth[90].Inverse() * synthetic.truth[190], LoopInformation());
    const KeyframeCorrection correction = graph.Optimize();
    EXPECT_TRUE(correction.success);
    ASSERT_EQ(correction.loops.size(), 2u);
    EXPECT_FALSE(correction.loops[0].down_weighted);
    EXPECT_FALSE(correction.loops[1].down_weighted);
    EXPECT_LT(correction.loops[0].chi2, correction.loops[0].chi2_before);
    EXPECT_LT(Error(correction, synthetic.truth), 0.8 * before) << ToString(kind);
  }
}

TEST(KeyframeGraph, AFalseLoopIsReportedAndDoesLittleHarm) {
  const auto synthetic = Drifting(GraphKind::kSE3);
  KeyframeGraph graph = FromOdometry(synthetic, GraphKind::kSE3);
  graph.AddLoop(5, 105, synthetic.truth[5].Inverse() * synthetic.truth[105], LoopInformation());
  const double good = Error(graph.Optimize(), synthetic.truth);
  graph.AddLoop(20, 50, Similarity(1, ExpSO3({0, 0, 0.3}), {0.5, 0, 0}),
                LoopInformation());  // they are 40 m apart
  const KeyframeCorrection correction = graph.Optimize();
  EXPECT_FALSE(correction.loops[0].down_weighted);
  EXPECT_TRUE(correction.loops[1].down_weighted);
  EXPECT_LT(correction.loops[1].weight, 0.01);
  EXPECT_LT(Error(correction, synthetic.truth), 1.1 * good + 0.05);
}

TEST(KeyframeGraph, ALoopJoinsTwoMapPieces) {
  // The second round was mapped after tracking was lost, in a frame of reference of its own (mono: and a
  // scale of its own).
  for (GraphKind kind : {GraphKind::kSE3, GraphKind::kSim3}) {
    testing::SyntheticGraphOptions options;
    options.kind = kind;
    const auto synthetic = testing::MakeSyntheticGraph(options);
    KeyframeGraphOptions graph_options;
    graph_options.kind = kind;
    KeyframeGraph graph(graph_options);
    const double scale = kind == GraphKind::kSim3 ? 0.4 : 1.0;
    const Similarity other(scale, ExpSO3({1, 2, 0.5}), {100, -50, 3});
    for (int id = 0; id < options.nodes; ++id) {
      const Similarity& truth = synthetic.truth[static_cast<std::size_t>(id)];
      Similarity pose = id < 60 ? truth : other * truth;
      pose.scale = 1.0;  // a map piece does not know its scale
      graph.AddKeyframe(id, pose, id < 60 ? 0 : 1);
    }
    Similarity loop = synthetic.truth[10].Inverse() * synthetic.truth[70];
    loop.scale = 1.0 / scale;
    graph.AddLoop(10, 70, loop, LoopInformation());
    const KeyframeCorrection correction = graph.Optimize();
    EXPECT_TRUE(correction.success);
    EXPECT_EQ(correction.merges, (std::map<int, int>{{1, 0}}));
    EXPECT_EQ(correction.report.components.size(), 1u);
    EXPECT_LT(Error(correction, synthetic.truth), 1e-4) << ToString(kind);
    EXPECT_NEAR(correction.S_world_keyframe.at(100).scale, 1.0 / scale, 1e-6);
  }
}

TEST(KeyframeGraph, SevenHundredKeyframesTakeMilliseconds) {
  const auto synthetic = Drifting(GraphKind::kSim3, 700);
  KeyframeGraph graph = FromOdometry(synthetic, GraphKind::kSim3);
  for (int id = 0; id + 2 < 700; ++id) graph.AddCovisibility(id, id + 2, 0.5);
  for (int id : {10, 12, 14, 200, 202}) {
    const std::size_t i = static_cast<std::size_t>(id), j = i + 350;
    graph.AddLoop(id, id + 350, synthetic.truth[i].Inverse() * synthetic.truth[j], LoopInformation());
  }
  const KeyframeCorrection correction = graph.Optimize();
  EXPECT_TRUE(correction.success);
  EXPECT_EQ(correction.report.down_weighted, 0u);
  RecordProperty("milliseconds", static_cast<int>(1e3 * correction.report.time_s));
  EXPECT_LT(correction.report.time_s,
            5.0);  // about 0.05 s; the bound leaves room for sanitizers and busy machines
}

TEST(KeyframeGraph, RefusesOptionsThatMakeNoSense) {
  KeyframeGraphOptions options;
  options.kind = GraphKind::kSE2;
  EXPECT_THROW(KeyframeGraph{options}, InputError);
  options = {};
  options.sigma_rotation_rad = 0;
  EXPECT_THROW(KeyframeGraph{options}, InputError);
}

}  // namespace
}  // namespace tutti
