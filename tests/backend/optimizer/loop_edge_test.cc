// A loop in a map whose keyframes have got other scales.
#include <gtest/gtest.h>

#include <map>

#include "tutti/backend/keyframe_graph.h"

namespace tutti {
namespace {

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
    std::vector<MapKeyframe> keyframes;
    keyframes.reserve(30);
    for (int id = 0; id < 30; ++id)
      keyframes.push_back({id, 0, Pose(Eigen::Quaterniond::Identity(), {1.0 * id, 0, 0})});
    graph.Update(keyframes);
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
