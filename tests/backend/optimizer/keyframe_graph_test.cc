#include "tutti/backend/keyframe_graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "core/dense_solvers.h"
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

std::vector<MapKeyframe> KeyframesOf(const testing::SyntheticGraph& synthetic) {
  std::vector<MapKeyframe> keyframes;
  for (const PoseGraphNode& node : synthetic.graph.nodes())
    keyframes.push_back({static_cast<int>(node.id), 0, node.pose.RigidPart()});
  return keyframes;
}

// A metre from each to the next.
std::vector<MapKeyframe> StraightLine(int count) {
  std::vector<MapKeyframe> keyframes;
  for (int id = 0; id < count; ++id)
    keyframes.push_back({id, 0, Pose(Eigen::Quaterniond::Identity(), {1.0 * id, 0, 0})});
  return keyframes;
}

KeyframeGraph FromOdometry(const testing::SyntheticGraph& synthetic, GraphKind kind) {
  KeyframeGraphOptions options;
  options.kind = kind;
  KeyframeGraph graph(options);
  graph.Update(KeyframesOf(synthetic));
  return graph;
}

LoopEdge TrueLoop(const testing::SyntheticGraph& synthetic, int candidate, int query) {
  const auto truth = [&](int id) { return synthetic.truth[static_cast<std::size_t>(id)]; };
  LoopEdge loop;
  loop.candidate = candidate;
  loop.query = query;
  loop.S_candidate_query = truth(candidate).Inverse() * truth(query);
  loop.information = MakeInformation(0.02, 0.01, 0.05);
  return loop;
}

double CorrectionError(const KeyframeCorrection& correction, const std::vector<Similarity>& truth) {
  double worst = 0;
  for (const auto& [id, pose] : correction.S_world_keyframe) {
    worst = std::max(worst, (pose.translation - truth[static_cast<std::size_t>(id)].translation).norm());
  }
  return worst;
}

TEST(KeyframeGraph, WithoutLoopsEveryKeyframeStaysWhereItIs) {
  const auto synthetic = Drifting(GraphKind::kSE3);
  const KeyframeCorrection correction = FromOdometry(synthetic, GraphKind::kSE3).Optimize({});
  EXPECT_TRUE(correction.success);
  for (const PoseGraphNode& node : synthetic.graph.nodes()) {
    EXPECT_LT((correction.S_world_keyframe.at(node.id).translation - node.pose.translation).norm(), 1e-9);
  }
}

TEST(KeyframeGraph, ATrueLoopPullsTheTrajectoryTogether) {
  for (GraphKind kind : {GraphKind::kSE3, GraphKind::kSim3}) {
    const auto synthetic = Drifting(kind);
    const KeyframeGraph graph = FromOdometry(synthetic, kind);
    const double before = CorrectionError(graph.Optimize({}), synthetic.truth);
    const KeyframeCorrection correction =
        graph.Optimize({TrueLoop(synthetic, 5, 105), TrueLoop(synthetic, 90, 190)});
    EXPECT_TRUE(correction.success);
    ASSERT_EQ(correction.loops.size(), 2u);
    EXPECT_FALSE(correction.loops[0].down_weighted);
    EXPECT_FALSE(correction.loops[1].down_weighted);
    EXPECT_LT(CorrectionError(correction, synthetic.truth), 0.8 * before) << ToString(kind);
  }
}

TEST(KeyframeGraph, ProvesItsSolutionWhereThereIsNoScale) {
  for (GraphKind kind : {GraphKind::kSE3, GraphKind::kSim3}) {
    const auto synthetic = Drifting(kind);
    const KeyframeGraph graph = FromOdometry(synthetic, kind);
    const std::vector<LoopEdge> loops = {TrueLoop(synthetic, 5, 105), TrueLoop(synthetic, 90, 190)};
    const KeyframeGraphProof proof = graph.Prove(loops);
    EXPECT_EQ(proof.best, GraphStart::kFile);
    EXPECT_FALSE(proof.better);
    EXPECT_GE(proof.starts.size(), 2u);
    EXPECT_EQ(proof.correction.S_world_keyframe.at(150).translation,
              graph.Optimize(loops).S_world_keyframe.at(150).translation);
    EXPECT_EQ(proof.certificate.available, kind == GraphKind::kSE3);
    EXPECT_EQ(proof.certificate.certified, kind == GraphKind::kSE3) << proof.certificate.reason;
  }
}

TEST(KeyframeGraph, AFalseLoopIsReportedAndDoesLittleHarm) {
  const auto synthetic = Drifting(GraphKind::kSE3);
  const KeyframeGraph graph = FromOdometry(synthetic, GraphKind::kSE3);
  const LoopEdge good = TrueLoop(synthetic, 5, 105);
  const double error = CorrectionError(graph.Optimize({good}), synthetic.truth);
  LoopEdge wrong = TrueLoop(synthetic, 20, 50);
  wrong.S_candidate_query = Similarity(1, ExpSO3({0, 0, 0.3}), {0.5, 0, 0});  // they are 40 m apart
  const KeyframeCorrection correction = graph.Optimize({good, wrong});
  EXPECT_FALSE(correction.loops[0].down_weighted);
  EXPECT_TRUE(correction.loops[1].down_weighted);
  EXPECT_LT(correction.loops[1].weight, 0.01);
  EXPECT_LT(CorrectionError(correction, synthetic.truth), 1.1 * error + 0.05);
}

// The second round was mapped after tracking was lost, in a frame of reference of its own (mono: and a scale
// of its own).
struct TwoPieces {
  testing::SyntheticGraph synthetic;
  std::vector<MapKeyframe> keyframes;
  LoopEdge loop;
  double scale = 1;
};

TwoPieces InTwoPieces(GraphKind kind) {
  testing::SyntheticGraphOptions options;
  options.kind = kind;
  TwoPieces out{testing::MakeSyntheticGraph(options), {}, {}, kind == GraphKind::kSim3 ? 0.4 : 1.0};
  const Similarity other(out.scale, ExpSO3({1, 2, 0.5}), {100, -50, 3});
  for (int id = 0; id < options.nodes; ++id) {
    const Similarity& truth = out.synthetic.truth[static_cast<std::size_t>(id)];
    const Similarity pose = id < 60 ? truth : other * truth;
    out.keyframes.push_back({id, id < 60 ? 0 : 1, pose.RigidPart()});  // a piece does not know its scale
  }
  out.loop = TrueLoop(out.synthetic, 10, 70);
  out.loop.S_candidate_query.scale = 1.0 / out.scale;
  return out;
}

TEST(KeyframeGraph, ALoopJoinsTwoMapPieces) {
  for (GraphKind kind : {GraphKind::kSE3, GraphKind::kSim3}) {
    const TwoPieces pieces = InTwoPieces(kind);
    KeyframeGraphOptions options;
    options.kind = kind;
    KeyframeGraph graph(options);
    graph.Update(pieces.keyframes);
    const KeyframeCorrection correction = graph.Optimize({pieces.loop});
    EXPECT_TRUE(correction.success);
    EXPECT_EQ(correction.merges, (std::map<int, int>{{1, 0}}));
    EXPECT_LT(CorrectionError(correction, pieces.synthetic.truth), 1e-4) << ToString(kind);
    EXPECT_NEAR(correction.S_world_keyframe.at(100).scale, 1.0 / pieces.scale, 1e-6);
  }
}

bool HasEdge(const PoseGraph& graph, int from, int to) {
  return std::any_of(graph.edges().begin(), graph.edges().end(),
                     [&](const PoseGraphEdge& e) { return e.from == from && e.to == to; });
}

TEST(KeyframeGraph, AKeyframeThatCameAfterTheJoinHasAnEdgeFromTheOneBefore) {
  TwoPieces pieces = InTwoPieces(GraphKind::kSE3);
  const MapKeyframe last = pieces.keyframes.back();
  pieces.keyframes.pop_back();
  KeyframeGraph graph;
  graph.Update(pieces.keyframes);
  const KeyframeCorrection correction = graph.Optimize({pieces.loop});
  graph.Move(correction.S_world_keyframe, correction.merges);
  for (MapKeyframe& keyframe : pieces.keyframes) {
    keyframe.T_world_keyframe = correction.S_world_keyframe.at(keyframe.id).RigidPart();
    keyframe.piece = 0;
  }
  pieces.keyframes.push_back({last.id, 0, pieces.keyframes.back().T_world_keyframe});
  graph.Update(pieces.keyframes);
  const PoseGraph after = graph.Graph({pieces.loop});
  EXPECT_TRUE(HasEdge(after, last.id - 1, last.id));
  EXPECT_FALSE(HasEdge(after, 59, 60)) << "nothing was measured between the pieces but the loop";
}

TEST(KeyframeGraph, MeasurementsFromBeforeACorrectionStay) {
  const auto synthetic = Drifting(GraphKind::kSE3);
  KeyframeGraph graph = FromOdometry(synthetic, GraphKind::kSE3);
  const PoseGraph before = graph.Graph({});
  const std::vector<LoopEdge> loops = {TrueLoop(synthetic, 5, 105)};
  const KeyframeCorrection correction = graph.Optimize(loops);
  graph.Move(correction.S_world_keyframe, correction.merges);
  std::vector<MapKeyframe> moved = KeyframesOf(synthetic);
  for (MapKeyframe& k : moved) k.T_world_keyframe = correction.S_world_keyframe.at(k.id).RigidPart();
  graph.Update(moved);
  const PoseGraph kept = graph.Graph({});
  graph.MeasureAgain();
  graph.Update(moved);
  const PoseGraph again = graph.Graph({});
  double changed = 0;
  for (std::size_t e = 0; e < before.edges().size(); ++e) {
    EXPECT_EQ(kept.edges()[e].measurement.translation, before.edges()[e].measurement.translation) << e;
    changed = std::max(
        changed,
        (again.edges()[e].measurement.translation - before.edges()[e].measurement.translation).norm());
  }
  EXPECT_GT(changed, 1e-4);
}

TEST(KeyframeGraph, OnlyTheStrongestCovisiblePairsGetAnEdge) {
  const auto synthetic = Drifting(GraphKind::kSE3, 10);
  KeyframeGraphOptions options;
  options.max_covisible = 2;
  KeyframeGraph graph(options);
  graph.Update(KeyframesOf(synthetic), {{3, 9, 100}, {4, 9, 300}, {5, 9, 200}, {8, 9, 900}});
  const PoseGraph built = graph.Graph({});
  EXPECT_TRUE(HasEdge(built, 4, 9));
  EXPECT_TRUE(HasEdge(built, 5, 9));
  EXPECT_FALSE(HasEdge(built, 3, 9));
  EXPECT_EQ(built.edges().size(), 9u + 2u) << "8 and 9 have one already";
}

TEST(KeyframeGraph, AnEdgeIsAsUncertainAsTheMotionsBetweenItsEnds) {
  KeyframeGraphOptions options;
  options.sigma_translation_ratio = 0;
  options.sigma_rotation_rad = 1e-4;
  KeyframeGraph graph(options);
  for (int id = 0; id < 4; ++id) graph.NoteMotion(id, {0.3 * id, 0.01 * id});
  graph.Update(StraightLine(5), {{0, 2, 100}});
  const PoseGraph known = graph.Graph({});
  for (const PoseGraphEdge& edge : known.edges()) {
    double translation2 = 0, rotation2 = 0;
    for (NodeId id = edge.from + 1; id <= std::min<NodeId>(edge.to, 3); ++id) {
      const double share = static_cast<double>(id * id);
      translation2 += 0.09 * share;
      rotation2 += 1e-4 * share;
    }
    if (edge.to == 4) {  // its motion was not noted
      EXPECT_GT(edge.information(0, 0), 1e4);
      EXPECT_NEAR(edge.information(3, 3), 1e8, 1);
    } else {
      EXPECT_NEAR(1 / edge.information(0, 0), translation2, 1e-9) << edge.from << " " << edge.to;
      EXPECT_NEAR(1 / edge.information(3, 3), rotation2, 1e-9) << edge.from << " " << edge.to;
    }
  }
  EXPECT_EQ(known.edges().size(), 5u);
}

TEST(KeyframeGraph, RefusesKeyframesOutOfOrderLoopsToUnknownOnesAndOptionsThatMakeNoSense) {
  KeyframeGraph graph;
  EXPECT_THROW(graph.Update({{1, 0, Pose()}, {0, 0, Pose()}}), InputError);
  EXPECT_THROW(graph.Update({{1, 0, Pose()}, {1, 0, Pose()}}), InputError);
  graph.Update({{0, 0, Pose()}, {1, 0, Pose()}});
  LoopEdge loop;
  loop.candidate = 0;
  loop.query = 7;
  EXPECT_THROW(graph.Optimize({loop}), InputError);
  KeyframeGraphOptions options;
  options.kind = GraphKind::kSE2;
  EXPECT_THROW(KeyframeGraph{options}, InputError);
  options = {};
  options.sigma_rotation_rad = 0;
  EXPECT_THROW(KeyframeGraph{options}, InputError);
}

// Two laps around the same loop: keyframe n / 2 + k is where k is.
TEST(KeyframeGraph, EdgesOfRemovedKeyframesLeadToWhatStandsForThem) {
  for (GraphKind kind : {GraphKind::kSE3, GraphKind::kSim3}) {
    const auto synthetic = Drifting(kind);
    KeyframeGraph graph = FromOdometry(synthetic, kind);
    std::vector<MapKeyframe> left = KeyframesOf(synthetic);
    std::map<int, int> into;
    for (int id = 101; id < 199; id += 2) into[id] = id - 100;
    into[1] = 0;  // and so is what 101 went into
    LoopEdge loop = TrueLoop(synthetic, 5, 105), closed = loop;
    EXPECT_FALSE(graph.Rehang(into, &closed)) << "both ends are one keyframe";
    loop.query = 107;
    loop.S_candidate_query = synthetic.truth[5].Inverse() * synthetic.truth[107];
    const LoopEdge before = loop;
    EXPECT_TRUE(graph.Rehang(into, &loop));
    EXPECT_EQ(loop.query, 7);
    const Similarity link = Similarity(left[107].T_world_keyframe.Inverse() * left[7].T_world_keyframe);
    EXPECT_LT((loop.S_candidate_query.translation - (before.S_candidate_query * link).translation).norm(),
              1e-9);
    const double before_turn = internal::Inverse(before.information)(3, 3),
                 turn = internal::Inverse(loop.information)(3, 3);
    EXPECT_GT(turn, 1.05 * before_turn) << "less sure";
    graph.Remove(into);
    left.erase(
        std::remove_if(left.begin(), left.end(), [&](const MapKeyframe& k) { return into.count(k.id) != 0; }),
        left.end());
    graph.Update(left);
    const PoseGraph small = graph.Graph({loop});
    EXPECT_EQ(small.nodes().size(), left.size());
    std::map<std::pair<NodeId, NodeId>, const PoseGraphEdge*> edges;
    for (const PoseGraphEdge& edge : small.edges()) {
      const bool is_new = edges.emplace(std::minmax(edge.from, edge.to), &edge).second;
      EXPECT_TRUE(is_new || edge.kind == EdgeKind::kLoop) << edge.from << ", " << edge.to;
      if (edge.kind == EdgeKind::kLoop) continue;
      const Similarity in_map = small.Node(edge.from).pose.Inverse() * small.Node(edge.to).pose;
      EXPECT_LT((edge.measurement.translation - in_map.translation).norm(), 1e-9);
    }
    // 102 was between 101 and 103, which are 1 and 3; 1 is 0.
    ASSERT_EQ(edges.count({0, 102}), 1u);
    ASSERT_EQ(edges.count({3, 102}), 1u);
    EXPECT_EQ(edges.count({100, 102}), 0u) << "nothing was measured between them";
    const double turned = edges.at({0, 102})->information(3, 3), step = edges.at({3, 4})->information(3, 3);
    EXPECT_NEAR(step / turned, 3, 0.01) << "three edges in a row have three times the variance";
    EXPECT_TRUE(graph.Optimize({}).success);
  }
}

// Between which nothing was measured, though there are edges from the one to others, and from others to it.
TEST(KeyframeGraph, AKeyframeMayGoIntoOneThatItHasNoEdgeTo) {
  for (const int other : {1, 4, 5}) {
    const auto synthetic = Drifting(GraphKind::kSE3, 10);
    std::vector<MapKeyframe> keyframes = KeyframesOf(synthetic);
    KeyframeGraph graph{KeyframeGraphOptions()};
    graph.Update(keyframes, {{1, 9, 100}, {4, 9, 100}, {5, 8, 100}});
    const auto at = [&](int id) { return keyframes[static_cast<std::size_t>(id)].T_world_keyframe; };
    LoopEdge loop;
    loop.candidate = 0;
    loop.query = 7;
    loop.information = MakeInformation(0.02, 0.01, 0.05);
    ASSERT_TRUE(graph.Rehang({{7, other}}, &loop));
    EXPECT_EQ(loop.query, other);
    const Pose expected = at(7).Inverse() * at(other);  // the loop itself says that 0 and 7 are in one place
    EXPECT_LT((loop.S_candidate_query.translation - expected.translation).norm(), 1e-12) << other;
    graph.Remove({{7, other}});
    keyframes.erase(keyframes.begin() + 7);
    graph.Update(keyframes);
    const PoseGraph small = graph.Graph({});
    for (const PoseGraphEdge& edge : small.edges()) {
      const Pose in_map = synthetic.graph.Node(edge.from).pose.RigidPart().Inverse() *
                          synthetic.graph.Node(edge.to).pose.RigidPart();
      EXPECT_LT((edge.measurement.translation - in_map.translation).norm(), 1e-12)
          << edge.from << ", " << edge.to << " after 7 went into " << other;
    }
  }
}

// Of two ways to the same keyframe the one over fewer edges is the surer one.
TEST(KeyframeGraph, AnEdgeThatIsThereIsNotReplacedByOneThatLeadsOverARemovedKeyframe) {
  const auto synthetic = Drifting(GraphKind::kSE3, 10);
  std::vector<MapKeyframe> keyframes = KeyframesOf(synthetic);
  KeyframeGraph graph{KeyframeGraphOptions()};
  graph.Update(keyframes, {{2, 4, 100}});
  const auto turn_variance = [&graph](NodeId from, NodeId to) {
    const PoseGraph built = graph.Graph({});
    for (const PoseGraphEdge& edge : built.edges()) {
      if (std::minmax(edge.from, edge.to) == std::minmax(from, to)) return 1 / edge.information(3, 3);
    }
    return 0.0;
  };
  const double direct = turn_variance(2, 4);
  EXPECT_GT(direct, 0);
  graph.Remove({{3, 2}, {7, 6}});
  keyframes.erase(keyframes.begin() + 7);
  keyframes.erase(keyframes.begin() + 3);
  graph.Update(keyframes);
  EXPECT_NEAR(turn_variance(2, 4), direct, 1e-9 * direct);
  EXPECT_NEAR(turn_variance(6, 8), 2 * direct, 1e-9 * direct) << "over 7";
}

// Length of the way that an edge's uncertainty is of, after keyframes of a path round corners have left.
double WayOf(const std::pair<int, int>& ends, const std::map<int, int>& into) {
  KeyframeGraphOptions options;
  options.sigma_translation_floor = 1e-12;
  std::vector<MapKeyframe> keyframes;
  for (const Eigen::Vector3d& at : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(3, 0, 0),
                                    Eigen::Vector3d(3, 4, 0), Eigen::Vector3d(3, 4, 12)})
    keyframes.push_back({static_cast<int>(keyframes.size()), 0, Pose(ExpSO3(0.1 * at), at)});
  KeyframeGraph graph(options);
  graph.Update(keyframes, {{0, 3, 100}});
  graph.Remove(into);
  const PoseGraph built = graph.Graph({});
  for (const PoseGraphEdge& edge : built.edges()) {
    if (std::minmax(edge.from, edge.to) == std::minmax<NodeId>(ends.first, ends.second))
      return 1 / std::sqrt(edge.information(0, 0)) / options.sigma_translation_ratio;
  }
  return 0;
}

// Errors of length add up along the way round a corner, not along the straight line.
TEST(KeyframeGraph, AnEdgeOverARemovedKeyframeIsAsUncertainAsItsWayIsLong) {
  EXPECT_NEAR(WayOf({0, 3}, {}), 13, 1e-3);
  EXPECT_NEAR(WayOf({0, 2}, {{1, 0}}), 3 + 4, 1e-3);
  EXPECT_NEAR(WayOf({1, 3}, {{2, 1}}), 4 + 12, 1e-3);
  EXPECT_NEAR(WayOf({0, 2}, {{3, 2}}), 13 + 12, 1e-3) << "from the newer one to an older one";
}

// Moves the keyframes as a loop asks; returns where they are then.
std::vector<MapKeyframe> Correct(const KeyframeCorrection& correction, KeyframeGraph* graph) {
  graph->Move(correction.S_world_keyframe, correction.merges);
  std::vector<MapKeyframe> moved;
  for (const auto& [id, S] : correction.S_world_keyframe) moved.push_back({id, 0, S.RigidPart()});
  graph->Update(moved);
  return moved;
}

// A correction moves the keyframes apart, but what was measured between them stays.
TEST(KeyframeGraph, ALoopOfARemovedKeyframeIsLedOnAsMeasured) {
  const auto synthetic = Drifting(GraphKind::kSE3);
  KeyframeGraph graph = FromOdometry(synthetic, GraphKind::kSE3);
  const KeyframeCorrection correction = graph.Optimize({TrueLoop(synthetic, 5, 105)});
  Correct(correction, &graph);
  LoopEdge loop = TrueLoop(synthetic, 5, 105);
  loop.S_candidate_query = Similarity();
  ASSERT_TRUE(graph.Rehang({{105, 104}}, &loop));
  const auto odometry = [&](int id) { return synthetic.graph.Node(id).pose; };
  const Similarity measured = odometry(105).Inverse() * odometry(104);
  const Similarity in_map =
      correction.S_world_keyframe.at(105).Inverse() * correction.S_world_keyframe.at(104);
  EXPECT_GT((measured.translation - in_map.translation).norm(), 1e-4);
  EXPECT_LT((loop.S_candidate_query.translation - measured.translation).norm(), 1e-9);
}

TEST(KeyframeGraph, RemovedKeyframesLeaveTheMeasurementsOfBeforeACorrection) {
  const auto synthetic = Drifting(GraphKind::kSE3);
  KeyframeGraph graph = FromOdometry(synthetic, GraphKind::kSE3);
  const KeyframeCorrection correction = graph.Optimize({TrueLoop(synthetic, 5, 105)});
  std::vector<MapKeyframe> moved = Correct(correction, &graph);
  graph.Remove({{50, 49}});
  moved.erase(moved.begin() + 50);
  graph.Update(moved);
  const PoseGraph small = graph.Graph({});
  const auto at = [&](int id) { return synthetic.graph.nodes()[static_cast<std::size_t>(id)].pose; };
  for (const PoseGraphEdge& edge : small.edges()) {
    const Similarity odometry = at(edge.from).Inverse() * at(edge.to);
    EXPECT_LT((edge.measurement.translation - odometry.translation).norm(), 1e-9) << edge.from;
  }
  EXPECT_EQ(small.edges().size(), 198u);
}

// The first keyframe of a recording that began in the map hangs on what it saw there, not on the end of the
// recording before.
TEST(KeyframeGraph, ARecordingThatBeginsIsTiedToWhatItSees) {
  const auto edges = [](const KeyframeGraph& graph) {
    std::vector<std::pair<int, int>> out;
    const PoseGraph built = graph.Graph({});
    for (const PoseGraphEdge& edge : built.edges()) out.emplace_back(edge.from, edge.to);
    std::sort(out.begin(), out.end());
    return out;
  };
  const std::vector<MapKeyframe> keyframes = StraightLine(40);
  KeyframeGraph graph, before;
  graph.Append(30);
  graph.Update(keyframes, {{4, 30, 80}});
  before.Update(keyframes, {{4, 30, 80}});
  auto expected = edges(before);
  EXPECT_EQ(std::count(expected.begin(), expected.end(), std::pair(29, 30)), 1);
  expected.erase(std::find(expected.begin(), expected.end(), std::pair(29, 30)));
  EXPECT_EQ(edges(graph), expected);
  // Without anything to see, it is not left alone.
  graph.Update(keyframes, {});
  const auto tied = edges(graph);
  EXPECT_EQ(std::count(tied.begin(), tied.end(), std::pair(29, 30)), 1);
}

// A camera that was lost, and had begun another piece, is found again in the first one.
TEST(KeyframeGraph, AKeyframeThatWasFoundAgainMovesWithItsPiece) {
  const auto synthetic = Drifting(GraphKind::kSE3, 100);
  std::vector<MapKeyframe> keyframes = KeyframesOf(synthetic);
  for (std::size_t id = 60; id < 70; ++id) keyframes[id].piece = 1;
  KeyframeGraph graph;
  graph.Update(keyframes);
  const std::vector<LoopEdge> loops = {TrueLoop(synthetic, 5, 90)};
  EXPECT_TRUE(HasEdge(graph.Graph(loops), 59, 70));
  EXPECT_FALSE(HasEdge(graph.Graph(loops), 69, 70)) << "of two pieces";
  EXPECT_FALSE(HasEdge(graph.Graph(loops), 59, 60)) << "of two pieces";
  const KeyframeCorrection correction = graph.Optimize(loops);
  ASSERT_TRUE(correction.success);
  EXPECT_TRUE(correction.merges.empty());
  const Pose& before = keyframes[70].T_world_keyframe;
  EXPECT_GT((correction.S_world_keyframe.at(70).translation - before.translation).norm(), 1e-4);
  // What it sees of the old keyframes says more than the last one of them.
  graph.Update(keyframes, {{20, 70, 150}});
  EXPECT_TRUE(HasEdge(graph.Graph(loops), 20, 70));
  EXPECT_FALSE(HasEdge(graph.Graph(loops), 59, 70));
}

Similarity OfScale(double scale) { return Similarity(scale, ExpSO3({0.1, -0.2, 0.3}), {4, 5, 6}); }

// The query's camera sees the same points at other coordinates: what maps them into the candidate's changes
// with both units, and a residual in the query's frame has the query's unit.
TEST(LoopEdge, MapsTheSamePointsInTheUnitsOfTheCorrectedMap) {
  constexpr double kCandidate = 2, kQuery = 0.5;
  LoopEdge loop;
  loop.candidate = 3;
  loop.query = 9;
  loop.S_candidate_query = Similarity(1.3, ExpSO3({0.3, 0.1, -0.2}), {1, -2, 0.5});
  loop.depth = 7;
  for (int r = 0; r < 7; ++r) {
    for (int c = 0; c < 7; ++c) loop.information(r, c) = r == c ? 10 + r : 1.0 / (1 + r + c);
  }
  const LoopEdge before = loop;
  Rescale({{3, OfScale(kCandidate)}, {9, OfScale(kQuery)}}, &loop);
  const Eigen::Vector3d in_query(0.4, -0.3, 2);
  EXPECT_LT(
      (loop.S_candidate_query * (kQuery * in_query) - kCandidate * (before.S_candidate_query * in_query))
          .norm(),
      1e-12);
  EXPECT_EQ(loop.depth, 14);
  Vector7d residual;
  residual << 0.1, -0.2, 0.3, 0.02, 0.05, -0.03, 0.04;
  Vector7d rescaled = residual;
  rescaled.head<3>() *= kQuery;
  const double chi2 = residual.transpose() * before.information * residual;
  const double chi2_rescaled = rescaled.transpose() * loop.information * rescaled;
  EXPECT_NEAR(chi2_rescaled, chi2, 1e-12);
}

TEST(LoopEdge, OfKeyframesThatKeepTheirScaleStays) {
  LoopEdge loop;
  loop.candidate = 3;
  loop.query = 9;
  loop.S_candidate_query = Similarity(1.3, ExpSO3({0.3, 0.1, -0.2}), {1, -2, 0.5});
  const LoopEdge before = loop;
  Rescale({{4, OfScale(3)}}, &loop);
  EXPECT_EQ(loop.S_candidate_query.scale, before.S_candidate_query.scale);
  EXPECT_EQ(loop.S_candidate_query.translation, before.S_candidate_query.translation);
  EXPECT_EQ(loop.information, before.information);
  EXPECT_EQ(loop.depth, before.depth);
}

// Uncertainty of the way between two keyframes is what the configuration says of a metre.
TEST(KeyframeGraphSigmas, OfTwiceTheNoiseLetALoopMoveTheMapMore) {
  const auto distance = [](double ratio, double rotation) {
    KeyframeGraph graph{KeyframeGraphOptions()};
    graph.Update(StraightLine(30));
    graph.SetSigmas(ratio, rotation);
    LoopEdge loop;
    loop.candidate = 0;
    loop.query = 29;
    loop.S_candidate_query = Similarity(1, Eigen::Quaterniond::Identity(), {29, 1, 0});
    loop.information = MakeInformation(1e-6, 1e-6, 1e-6);
    return graph.Distances({}, {loop}).at(0).value();
  };
  // An aside of a metre, by turns alone: their number of standard deviations halves where these double.
  EXPECT_NEAR(distance(1e-9, 0.02) / distance(1e-9, 0.01), 0.5, 0.05);
  EXPECT_LT(distance(0.05, 0.01), distance(0.01, 0.01));
  KeyframeGraph graph{KeyframeGraphOptions()};
  EXPECT_ANY_THROW(graph.SetSigmas(0.01, 0));
}

}  // namespace
}  // namespace tutti
