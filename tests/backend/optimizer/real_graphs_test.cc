// Published graphs against the costs that the best solvers reach (reference_optima.md).
#include <gtest/gtest.h>

#include <random>

#include "tests/backend/graph/synthetic_graph.h"
#include "tests/support/test_data.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

struct Reference {
  const char* name;
  double chi2;
};

class RealGraph : public ::testing::TestWithParam<Reference> {};

TEST_P(RealGraph, ReachesTheReferenceFromTheChordalInitialization) {
  TUTTI_REQUIRE_DATA(folder, "posegraphs");
  G2oFile file = ReadG2o(folder / (std::string(GetParam().name) + ".g2o"));
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  options.init = GraphInit::kChordal;
  const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(file.graph);
  EXPECT_TRUE(report.success) << report.reason;
  EXPECT_EQ(report.termination, "converged");
  EXPECT_LE(report.costs.chi2, GetParam().chi2 * (1 + 1e-6));
}

INSTANTIATE_TEST_SUITE_P(
    Published, RealGraph,
    ::testing::Values(Reference{"sphere2500", 727.14967}, Reference{"parking-garage", 1.2386906},
                      Reference{"intel", 45.004696}, Reference{"manhattanOlson3500", 146.07661},
                      Reference{"kitti_00", 98.322012}, Reference{"manhattan", 3549.0368},
                      Reference{"torus3D", 14574.746}),
    [](const auto& test) { return testing::TestName(test.param.name); });

TEST(RealGraphs, AutoPicksTheChordalStartWhereOdometryIsFarOff) {
  TUTTI_REQUIRE_DATA(file, "posegraphs/manhattan.g2o");
  G2oFile graph = ReadG2o(file);
  EXPECT_FALSE(graph.has_all_vertices);
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph.graph);
  EXPECT_EQ(report.start, GraphStart::kChordalRelaxation);
  EXPECT_LE(report.costs.chi2, 3549.0368 * (1 + 1e-6));
}

/// M3500c and worse: noise of 0.3 rad on the headings that a graph measures.
PoseGraph WithNoisyHeadings(const PoseGraph& clean, unsigned seed) {
  constexpr double kSigma = 0.3;
  std::mt19937 random(seed);
  PoseGraph noisy(clean.kind());
  for (const PoseGraphNode& node : clean.nodes()) noisy.AddNode(node);
  for (PoseGraphEdge edge : clean.edges()) {
    edge.measurement.rotation = edge.measurement.rotation * ExpSO3({0, 0, kSigma * testing::Gauss(random)});
    edge.information(5, 5) = 1 / (1 / edge.information(5, 5) + kSigma * kSigma);
    noisy.AddEdge(edge);
  }
  return noisy;
}

// The chordal relaxation alone leads to 1.2 to 1.6 times as much on every third of these graphs.
TEST(RealGraphs, NoisyHeadingsDoNotKeepTheChordalStartFromTheBottom) {
  TUTTI_REQUIRE_DATA(file, "posegraphs/manhattanOlson3500.g2o");
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  options.solver = PoseGraphSolver::kBlock;
  options.init = GraphInit::kChordal;
  PoseGraph clean = ReadG2o(file).graph;
  PoseGraphOptimizer(options).Optimize(clean);
  for (unsigned seed : {1u, 2u, 3u, 4u}) {
    PoseGraph noisy = WithNoisyHeadings(clean, seed), from_truth = noisy;
    const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(noisy);
    options.init = GraphInit::kFile;
    const PoseGraphReport best = PoseGraphOptimizer(options).Optimize(from_truth);
    options.init = GraphInit::kChordal;
    EXPECT_LE(report.costs.chi2, 1.01 * best.costs.chi2) << "seed " << seed;
  }
}

TEST(RealGraphs, TrueLoopsSurviveTheRobustLosses) {
  TUTTI_REQUIRE_DATA(file, "posegraphs/intel.g2o");
  for (RobustLoss robust : {RobustLoss::kHuber, RobustLoss::kDcs, RobustLoss::kGnc}) {
    G2oFile graph = ReadG2o(file);
    PoseGraphOptions options;
    options.objective = GraphObjective::kChi2;
    options.robust = robust;
    const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph.graph);
    EXPECT_LE(report.costs.chi2, 45.004696 * (1 + 1e-6)) << ToString(robust);
    EXPECT_EQ(report.down_weighted, 0u) << ToString(robust);
  }
}

}  // namespace
}  // namespace tutti
