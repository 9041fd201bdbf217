#include "tutti/backend/certificate.h"

#include <gtest/gtest.h>

#include "tests/backend/graph/synthetic_graph.h"
#include "tests/support/test_data.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

testing::SyntheticGraph NoisyGraphOf(GraphKind kind, double noise = 0.02) {
  testing::SyntheticGraphOptions options;
  options.kind = kind;
  options.noise_translation = options.noise_rotation = noise;
  return testing::MakeSyntheticGraph(options);
}

TEST(Certificate, ProvesTheOptimumOfAGraphWithModerateNoise) {
  for (GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3}) {
    PoseGraph graph = NoisyGraphOf(kind).graph;
    PoseGraphOptimizer().Optimize(graph);
    const Certificate certificate = CertifyOptimum(graph);
    EXPECT_TRUE(certificate.available) << certificate.reason;
    EXPECT_TRUE(certificate.certified) << certificate.reason << " gap " << certificate.relative_gap;
    EXPECT_LE(certificate.chordal, EvaluateCosts(graph).chordal * (1 + 1e-9));
    EXPECT_LE(certificate.lower_bound, certificate.chordal);
    EXPECT_LE(certificate.relative_gap, 1e-6);
  }
}

TEST(Certificate, IsNotAvailableIfTheCallerStopsIt) {
  const PoseGraph graph = NoisyGraphOf(GraphKind::kSE3).graph;
  for (const int when : {1, 4}) {
    int asked = 0;
    const Certificate certificate = CertifyOptimum(graph, {}, {}, [&] { return ++asked >= when; });
    EXPECT_EQ(asked, when);
    EXPECT_FALSE(certificate.available);
    EXPECT_FALSE(certificate.certified);
    EXPECT_EQ(certificate.reason, "stopped by the caller");
  }
}

// A ring whose rotations wind once too often is a stationary point, and a wrong one.
TEST(Certificate, RefusesALocalMinimum) {
  constexpr int kNodes = 20;
  PoseGraph graph(GraphKind::kSE2);
  const Matrix7d information = MakeInformation(10.0, 0.1);  // the rotations decide
  for (int k = 0; k < kNodes; ++k) {
    const double angle = 2 * M_PI * k / kNodes;
    graph.AddNode(k, Similarity(1, ExpSO3({0, 0, angle}), {0, 0, 0}));
  }
  const Similarity none;
  for (int k = 0; k + 1 < kNodes; ++k) graph.AddOdometry(k, k + 1, none, information);
  graph.AddLoop(kNodes - 1, 0, none, information);
  const Certificate wound = CertifyOptimum(graph);
  EXPECT_TRUE(wound.available);
  EXPECT_GT(wound.chordal, 1.0);
  EXPECT_FALSE(wound.certified);
  EXPECT_LT(wound.lower_bound, 1e-9);  // without the winding the cost is zero
  EXPECT_FALSE(wound.reason.empty());
}

// The bound of one shift for all rotations is negative here, which says nothing.
TEST(Certificate, BoundsTheCostWhereTheRelaxationIsNotTight) {
  for (const double noise : {0.3, 0.4}) {
    PoseGraph graph = NoisyGraphOf(GraphKind::kSE3, noise).graph;
    PoseGraphOptions options;
    options.init = GraphInit::kChordal;
    PoseGraphOptimizer(options).Optimize(graph);
    const Certificate certificate = CertifyOptimum(graph);
    EXPECT_FALSE(certificate.certified);
    EXPECT_GT(certificate.lower_bound, 0.9 * certificate.chordal) << noise;
    EXPECT_LT(certificate.lower_bound, certificate.chordal);
    EXPECT_NEAR(certificate.relative_gap, 1 - certificate.lower_bound / certificate.chordal, 1e-12);
  }
}

// It is one of a function's minimum, so no poses can have less, from wherever it was found.
TEST(Certificate, BoundsFromAWorsePlaceStayBelowTheOptimum) {
  testing::SyntheticGraphOptions options = testing::NoisyOptions(GraphKind::kSE2, 0.02, 0.15);
  options.false_loops = 6;
  PoseGraph graph = testing::MakeSyntheticGraph(options).graph;
  PoseGraphOptions chordal;
  chordal.init = GraphInit::kChordal;
  PoseGraph best = graph;
  ASSERT_TRUE(PoseGraphOptimizer(chordal).Optimize(best).success);
  const double optimum = CertifyOptimum(best).chordal;
  const Certificate elsewhere = CertifyOptimum(graph);  // the minimum next to the odometry
  EXPECT_LE(elsewhere.lower_bound, optimum * (1 + 1e-9));
}

TEST(Certificate, HoldsForGraphsWithoutNoiseAndForSeveralParts) {
  testing::SyntheticGraphOptions options;
  PoseGraph exact = testing::MakeSyntheticGraph(options).graph;
  EXPECT_TRUE(CertifyOptimum(exact).certified);
  PoseGraph parts = NoisyGraphOf(GraphKind::kSE3).graph;
  for (int id = 500; id < 504; ++id) parts.AddNode(id, Pose());
  for (int id = 500; id < 503; ++id) {
    parts.AddOdometry(id, id + 1, Similarity(1, ExpSO3({0.1, 0, 0}), {1, 0, 0}), MakeInformation(0.1, 0.1));
  }
  PoseGraphOptimizer().Optimize(parts);
  EXPECT_TRUE(CertifyOptimum(parts).certified);
}

// So little noise that the bound's rounding is more than the accepted share of the cost.
TEST(Certificate, HoldsWhereTheGapIsOnlyRounding) {
  for (const GraphKind kind : {GraphKind::kSE2, GraphKind::kSE3}) {
    PoseGraph graph = NoisyGraphOf(kind, 1e-7).graph;
    PoseGraphOptimizer().Optimize(graph);
    const Certificate certificate = CertifyOptimum(graph);
    EXPECT_GT(certificate.relative_gap, CertificateOptions().certified_gap);
    EXPECT_TRUE(certificate.certified) << certificate.reason << " gap " << certificate.relative_gap;
  }
}

TEST(Certificate, SaysWhyThereIsNone) {
  EXPECT_FALSE(CertifyOptimum(PoseGraph()).available);
  EXPECT_NE(CertifyOptimum(NoisyGraphOf(GraphKind::kSim3).graph).reason.find("scale"), std::string::npos);
  PoseGraph fixed = NoisyGraphOf(GraphKind::kSE3).graph;
  fixed.SetFixed(0, true);
  EXPECT_TRUE(CertifyOptimum(fixed).available);
  fixed.SetFixed(7, true);
  EXPECT_NE(CertifyOptimum(fixed).reason.find("fixed"), std::string::npos);
  CertificateOptions options;
  options.certified_gap = 0;
  EXPECT_THROW(CertifyOptimum(fixed, options), InputError);
}

struct Published {
  const char* name;
  double chordal;  // reference_optima.md
};

TEST(Certificate, IsWithinTwoPerMilleOnM3500b) {
  TUTTI_REQUIRE_DATA(file, "posegraphs/M3500b.g2o");
  PoseGraph graph = ReadG2o(file).graph;
  PoseGraphOptions options;
  options.init = GraphInit::kChordal;
  ASSERT_TRUE(PoseGraphOptimizer(options).Optimize(graph).success);
  const Certificate certificate = CertifyOptimum(graph);
  EXPECT_FALSE(certificate.certified);
  EXPECT_LE(certificate.relative_gap, 2e-3);  // one shift for all rotations: 1e-2
}

class CertificateOfPublishedGraph : public ::testing::TestWithParam<Published> {};

TEST_P(CertificateOfPublishedGraph, FindsAndProvesTheOptimumOfSeSync) {
  TUTTI_REQUIRE_DATA(folder, "posegraphs");
  PoseGraph graph = ReadG2o(folder / (std::string(GetParam().name) + ".g2o")).graph;
  PoseGraphOptions options;
  options.init = GraphInit::kChordal;
  ASSERT_TRUE(PoseGraphOptimizer(options).Optimize(graph).success);
  const Certificate certificate = CertifyOptimum(graph);
  EXPECT_TRUE(certificate.certified) << certificate.reason << " gap " << certificate.relative_gap;
  EXPECT_LE(certificate.relative_gap, 2e-7);
  EXPECT_LE(certificate.chordal, GetParam().chordal * (1 + 2e-7));
}

INSTANTIATE_TEST_SUITE_P(Published, CertificateOfPublishedGraph,
                         ::testing::Values(Published{"sphere2500", 1687.0058}, Published{"intel", 52.348228},
                                           Published{"manhattan", 6431.391},
                                           Published{"manhattanOlson3500", 204.94298},
                                           Published{"torus3D", 24227.046},
                                           Published{"parking-garage", 1.262526},
                                           Published{"kitti_00", 125.69351}),
                         [](const auto& test) { return testing::TestName(test.param.name); });

}  // namespace
}  // namespace tutti
