// What must not matter for the optimum: where the graph lies, which node holds it, how a rotation of half a
// turn is written.
#include <gtest/gtest.h>

#include "tests/backend/graph/synthetic_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

PoseGraph NoisyGraph(GraphKind kind) {
  return testing::MakeSyntheticGraph(testing::NoisyOptions(kind, 0.02, 0.01)).graph;
}

PoseGraph MovedGraph(const PoseGraph& graph, const Similarity& shift) {
  PoseGraph out = graph;
  for (const PoseGraphNode& node : graph.nodes()) out.SetPose(node.id, shift * node.pose);
  return out;
}

/// Largest distance [m] between the nodes of `a`, seen from node 0, and those of `b`.
double ShapeDifference(const PoseGraph& a, const PoseGraph& b) {
  double largest = 0;
  for (const PoseGraphNode& node : a.nodes()) {
    const Similarity in_a = a.Node(0).pose.Inverse() * node.pose;
    const Similarity in_b = b.Node(0).pose.Inverse() * b.Node(node.id).pose;
    largest = std::max(largest, (in_a.translation - in_b.translation).norm());
  }
  return largest;
}

TEST(PoseGraphNumerics, TheOptimumDoesNotDependOnWhereTheGraphLies) {
  for (const GraphKind kind : testing::kGraphKinds) {
    PoseGraph graph = NoisyGraph(kind);
    const bool planar = kind == GraphKind::kSE2;
    PoseGraph moved = MovedGraph(
        graph, Similarity(1, ExpSO3(planar ? Eigen::Vector3d(0, 0, 2) : Eigen::Vector3d(0.3, -1, 2)),
                          {1e3, -500, planar ? 0.0 : 77.0}));
    const double objective = PoseGraphOptimizer().Optimize(graph).objective;
    EXPECT_NEAR(PoseGraphOptimizer().Optimize(moved).objective, objective, 1e-8 * objective)
        << ToString(kind);
    EXPECT_LT(ShapeDifference(graph, moved), 1e-5) << ToString(kind);
  }
}

TEST(PoseGraphNumerics, AMillionMetresFromTheOriginTheOptimumIsAsExactAsThere) {
  for (const GraphKind kind : testing::kGraphKinds) {
    for (const GraphInit init : {GraphInit::kFile, GraphInit::kOdometry, GraphInit::kChordal}) {
      PoseGraph graph = NoisyGraph(kind);
      const Similarity shift(1, Eigen::Quaterniond::Identity(),
                             {1e6, -1e6, kind == GraphKind::kSE2 ? 0 : 1e6});
      PoseGraph far = MovedGraph(graph, shift);
      PoseGraphOptions options;
      options.init = init;
      const double objective = PoseGraphOptimizer(options).Optimize(graph).objective;
      const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(far);
      EXPECT_EQ(report.termination, "converged");
      EXPECT_NEAR(report.objective, objective, 1e-7 * objective) << ToString(kind) << " " << ToString(init);
      EXPECT_LT(ShapeDifference(graph, far), 1e-6) << ToString(kind) << " " << ToString(init);
    }
  }
}

TEST(PoseGraphNumerics, AnyNodeMayHoldTheGraph) {
  for (const GraphKind kind : testing::kGraphKinds) {
    if (kind == GraphKind::kSim3) continue;  // there the node that is held sets the unit of length
    PoseGraph first = NoisyGraph(kind), other = first;
    other.SetFixed(77, true);
    const Similarity held = other.Node(77).pose;
    const double objective = PoseGraphOptimizer().Optimize(first).objective;
    const PoseGraphReport report = PoseGraphOptimizer().Optimize(other);
    EXPECT_EQ(report.components[0].anchor, 77);
    EXPECT_EQ(other.Node(77).pose.translation, held.translation);
    EXPECT_NEAR(report.objective, objective, 1e-8 * objective) << ToString(kind);
    EXPECT_LT(ShapeDifference(first, other), 1e-5) << ToString(kind);
  }
}

/// Back and forth along a line with half a turn between two nodes, about `axis`, closed by a loop of no turn.
PoseGraph HalfTurns(GraphKind kind, const Eigen::Vector3d& axis, double angle, double perturbation) {
  PoseGraph graph(kind);
  const Similarity turn(1, ExpSO3(angle * axis), {1, 0, 0});
  Similarity pose;
  for (int id = 0; id < 6; ++id) {
    graph.AddNode(id,
                  id == 0 ? pose : pose * Similarity(1, ExpSO3(perturbation * axis), {0, perturbation, 0}));
    if (id > 0) graph.AddOdometry(id - 1, id, turn, Matrix7d::Identity());
    pose = pose * turn;
  }
  graph.AddLoop(0, 4, turn * turn * turn * turn, Matrix7d::Identity());
  return graph;
}

TEST(PoseGraphNumerics, RotationsOfHalfATurnAndCloseToItConverge) {
  for (const GraphKind kind : testing::kGraphKinds) {
    for (const Eigen::Vector3d& axis :
         {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0.6, 0, 0.8)}) {
      if (kind == GraphKind::kSE2 && axis.z() != 1) continue;
      for (const double angle : {M_PI, -M_PI, M_PI - 1e-6, -M_PI + 1e-9, M_PI + 1e-9}) {
        for (const GraphObjective objective : {GraphObjective::kChi2, GraphObjective::kChi2Log}) {
          for (const GraphInit init : {GraphInit::kFile, GraphInit::kChordal}) {
            PoseGraph graph = HalfTurns(kind, axis, angle, 0.3);
            PoseGraphOptions options;
            options.objective = objective;
            options.init = init;
            const PoseGraphReport report = PoseGraphOptimizer(options).Optimize(graph);
            EXPECT_TRUE(report.success) << report.reason;
            EXPECT_LT(report.costs.chi2log, 1e-12)
                << ToString(kind) << " " << angle << " " << ToString(objective) << " " << ToString(init);
          }
        }
      }
    }
  }
}

TEST(PoseGraphNumerics, PlusAndMinusHalfATurnAreOneMeasurement) {
  for (const GraphKind kind : testing::kGraphKinds) {
    PoseGraph graph(kind);
    graph.AddNode(0, Similarity());
    graph.AddNode(1, Similarity());
    for (const double angle : {M_PI, -M_PI})
      graph.AddLoop(0, 1, Similarity(1, ExpSO3({0, 0, angle}), {1, 2, 0}), Matrix7d::Identity());
    EXPECT_LT(PoseGraphOptimizer().Optimize(graph).costs.chi2log, 1e-20) << ToString(kind);
  }
}

}  // namespace
}  // namespace tutti
