// Landmarks and priors of g2o files: their costs, their optimum, and that they are written back.
#include <ceres/ceres.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "backend/solver/measurement_terms.h"
#include "core/text_reader.h"
#include "tests/backend/graph/synthetic_graph.h"
#include "tests/support/error_of.h"
#include "tests/support/test_data.h"
#include "tutti/backend/certificate.h"
#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti {
namespace {

using ::testing::HasSubstr;

G2oFile Read(const std::string& text) { return ReadG2o(testing::FreshFile("graph.g2o", text)); }

std::string Words(std::initializer_list<double> numbers) {
  std::string out;
  char word[32];
  for (const double number : numbers) {
    std::snprintf(word, sizeof word, " %.12g", number);
    out += word;
  }
  return out;
}

/// Along a curve with two landmarks. The odometry turns too much, the vertices follow it.
class MeasuredCurve {
 public:
  static constexpr int kNodes = 12;
  const Eigen::Vector2d landmarks[2] = {{3, 4}, {8, -1}};

  MeasuredCurve() {
    for (int k = 0; k < kNodes; ++k) truth.emplace_back(0.8 * k, 0.05 * k * k, 0.1 * k);
    Eigen::Vector3d drifted = truth[0];
    for (int k = 0; k < kNodes; ++k) {
      vertices += "VERTEX_SE2 " + std::to_string(k) + Words({drifted.x(), drifted.y(), drifted.z()}) + "\n";
      if (k + 1 == kNodes) break;
      Eigen::Vector3d step = truth[std::size_t(k) + 1] - truth[std::size_t(k)];
      step.head<2>() = Eigen::Rotation2Dd(-truth[std::size_t(k)].z()) * step.head<2>();
      step.z() += 0.05;
      odometry += "EDGE_SE2 " + std::to_string(k) + " " + std::to_string(k + 1) +
                  Words({step.x(), step.y(), step.z()}) + " 1 0 0 1 0 1\n";
      drifted.head<2>() += Eigen::Rotation2Dd(drifted.z()) * step.head<2>();
      drifted.z() += step.z();
    }
  }

  /// From node `k` landmark `l` as seen by a sensor at `x` in front of the node.
  Eigen::Vector2d Seen(int k, int l, double x = 0) const {
    const Eigen::Vector3d& node = truth[static_cast<std::size_t>(k)];
    Eigen::Vector2d seen = Eigen::Rotation2Dd(-node.z()) * (landmarks[l] - node.head<2>());
    seen.x() -= x;
    return seen;
  }

  double ErrorOf(const PoseGraph& graph) const {
    double largest = 0;
    for (const PoseGraphNode& node : graph.nodes()) {
      const Eigen::Vector3d off = node.pose.translation - Position(node.id);
      largest = std::max(largest, off.norm());
    }
    return largest;
  }
  Eigen::Vector3d Position(NodeId k) const {
    const Eigen::Vector3d& node = truth[static_cast<std::size_t>(k)];
    return {node.x(), node.y(), 0};
  }

  std::vector<Eigen::Vector3d> truth;
  std::string vertices, odometry;
};

PoseGraphReport SolveMeasured(PoseGraph& graph, RobustLoss robust = RobustLoss::kNone) {
  PoseGraphOptions options;
  options.objective = GraphObjective::kChi2;
  options.solver = PoseGraphSolver::kBlock;
  options.robust = robust;
  return PoseGraphOptimizer(options).Optimize(graph);
}

TEST(Measurements, LandmarksCorrectTheOdometryAndAreWrittenBack) {
  const MeasuredCurve curve;
  std::string text = "PARAMS_SE2OFFSET 3 0.5 0 0\n" + curve.vertices + curve.odometry +
                     "VERTEX_XY 100 0 0\nVERTEX_XY 101 0 0\nFIX 0\n";
  for (int k = 0; k < MeasuredCurve::kNodes; ++k) {
    for (int l = 0; l < 2; ++l) {
      const std::string ids = " " + std::to_string(k) + " " + std::to_string(100 + l);
      const Eigen::Vector2d seen = curve.Seen(k, l), ahead = curve.Seen(k, l, 0.5);
      text += "EDGE_SE2_XY" + ids + Words({seen.x(), seen.y()}) + " 1e8 0 1e8\n";
      text += "EDGE_SE2_XY_OFFSET" + ids + " 3" + Words({ahead.x(), ahead.y()}) + " 1e8 0 1e8\n";
      text += "EDGE_BEARING_SE2_XY" + ids + Words({std::atan2(seen.y(), seen.x())}) + " 1e8\n";
    }
  }
  PoseGraph graph = Read(text).graph;
  EXPECT_GT(curve.ErrorOf(graph), 1);
  EXPECT_EQ(graph.nodes().size(), static_cast<std::size_t>(MeasuredCurve::kNodes));
  const PoseGraphReport report = SolveMeasured(graph);
  ASSERT_TRUE(report.success) << report.reason;
  EXPECT_EQ(report.solver, PoseGraphSolver::kCeres);
  EXPECT_FALSE(report.solver_note.empty());
  EXPECT_LT(curve.ErrorOf(graph), 1e-4);
  for (int l = 0; l < 2; ++l)
    EXPECT_LT((graph.landmarks()[std::size_t(l)].position.head<2>() - curve.landmarks[l]).norm(), 1e-4);
  EXPECT_FALSE(CertifyOptimum(graph).available);
  const std::filesystem::path file = testing::FreshFolder() / "out.g2o";
  WriteG2o(file, graph);
  const std::string written = internal::ReadText(file, "", std::size_t{1} << 20);
  EXPECT_THAT(written, HasSubstr("PARAMS_SE2OFFSET 3 0.5 0 0\n"));
  EXPECT_THAT(written, HasSubstr("EDGE_BEARING_SE2_XY 0 100 "));
  const PoseGraph again = ReadG2o(file).graph;
  EXPECT_EQ(again.measurements().size(), 6u * MeasuredCurve::kNodes);
  EXPECT_LT((again.landmarks()[0].position - graph.landmarks()[0].position).norm(), 1e-12);
  EXPECT_NEAR(EvaluateCosts(again).chi2, EvaluateCosts(graph).chi2, 1e-9 * EvaluateCosts(graph).chi2);
}

TEST(Measurements, PositionsInTheWorldAreEnoughToHoldAGraph) {
  const MeasuredCurve curve;
  std::string text = curve.odometry;  // no vertices: the start has to come from the edges and the priors
  for (int k = 0; k < MeasuredCurve::kNodes; k += 2) {
    const Eigen::Vector3d at = curve.Position(k);
    text += "EDGE_PRIOR_SE2_XY " + std::to_string(k) + Words({500 - at.y(), 700 + at.x()}) + " 1e6 0 1e6\n";
  }
  PoseGraph graph = Read(text).graph;  // turned by 90 degrees
  const PoseGraphReport report = SolveMeasured(graph);
  ASSERT_TRUE(report.success) << report.reason;
  ASSERT_EQ(report.components.size(), 1u);
  EXPECT_TRUE(report.components[0].by_priors);
  for (const PoseGraphNode& node : graph.nodes()) {
    const Eigen::Vector3d at = curve.Position(node.id), expected(500 - at.y(), 700 + at.x(), 0);
    EXPECT_LT((node.pose.translation - expected).norm(), node.id % 2 == 0 ? 0.01 : 0.2) << node.id;
  }
}

TEST(Measurements, FalseLoopsAreRejectedInAGraphWithLandmarks) {
  const MeasuredCurve curve;
  std::string text = curve.vertices + curve.odometry + "EDGE_SE2 0 11 0 0 0 1e4 0 0 1e4 0 1e4\n";
  for (int k = 0; k < MeasuredCurve::kNodes; ++k) {
    for (int l = 0; l < 2; ++l)
      text += "EDGE_SE2_XY " + std::to_string(k) + " " + std::to_string(100 + l) +
              Words({curve.Seen(k, l).x(), curve.Seen(k, l).y()}) + " 1e6 0 1e6\n";
  }
  const G2oFile file = Read(text);
  for (const auto& [word, robust] : WordsOf(RobustLoss())) {
    if (robust == RobustLoss::kNone || robust == RobustLoss::kHuber) continue;
    PoseGraph graph = file.graph;
    const PoseGraphReport report = SolveMeasured(graph, robust);
    ASSERT_TRUE(report.success) << word;
    EXPECT_EQ(report.down_weighted, 1u) << word;
    EXPECT_LT(curve.ErrorOf(graph), 0.05) << word;
  }
}

TEST(Measurements, AFixedLandmarkHoldsTheGraph) {
  PoseGraph graph =
      Read(
          "VERTEX_SE2 0 0 0 0\nVERTEX_SE2 1 1 0 0\nVERTEX_XY 9 10 10\nVERTEX_XY 8 0 0\nFIX 9\n"
          "EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\nEDGE_SE2_XY 0 9 5 5 1 0 1\nEDGE_SE2_XY 1 9 4 5 1 0 1\n")
          .graph;
  const PoseGraphReport report = SolveMeasured(graph);
  ASSERT_TRUE(report.success);
  EXPECT_LT(report.costs.chi2, 1e-12);
  EXPECT_EQ(graph.landmarks()[0].position, Eigen::Vector3d(10, 10, 0));
}

TEST(Measurements, OfWhatIsMissingOrMixedUpNameTheLine) {
  const auto error = [](const std::string& text) {
    return testing::ErrorOf([&] { Read("EDGE_SE2 0 1 1 0 0 1 0 0 1 0 1\n" + text); });
  };
  EXPECT_THAT(error("EDGE_SE2_XY 0 1 1 1 1 0 1\n"), HasSubstr(":2: 1 is a pose in one line and a landmark"));
  EXPECT_THAT(error("VERTEX_XY 7 0 0\nEDGE_SE2 1 7 1 0 0 1 0 0 1 0 1\n"),
              HasSubstr(":3: 7 is a landmark, not a pose"));
  EXPECT_THAT(error("EDGE_SE2_XY_OFFSET 0 9 4 1 1 1 0 1\n"), HasSubstr(":2: refers to the parameters 4"));
  EXPECT_THAT(error("EDGE_BEARING_SE2_XY 0 9 0.1 100\n"), HasSubstr("landmark 9 has bearings but no vertex"));
  EXPECT_THAT(error("EDGE_PRIOR_SE2_XY 0 1 1 1 2 1\n"), HasSubstr(":2: its information matrix is not"));
  EXPECT_THAT(error("EDGE_PRIOR_SE2_XY 0 1 1 1 1\n"), HasSubstr(":2: EDGE_PRIOR_SE2_XY has 5 numbers; 6"));
  EXPECT_THAT(error("VERTEX_TRACKXYZ 9 0 0 0\n"), HasSubstr(":2: VERTEX_TRACKXYZ in a graph of SE(2)"));
}

/// Largest difference between the analytic gradient of half the cost and its central difference.
template <int N>
double GradientError(const PoseGraph& graph, GraphObjective objective) {
  internal::MeasurementTerms<N> terms(graph, objective);
  const std::size_t size = static_cast<std::size_t>(internal::BlockSize<N>());
  std::vector<double> blocks(graph.nodes().size() * size);
  const auto place = [&](const PoseGraph& at) {
    for (std::size_t k = 0; k < at.nodes().size(); ++k)
      internal::PoseToBlock<N>(at.nodes()[k].pose, &blocks[k * size]);
    for (std::size_t k = 0; k < at.landmarks().size(); ++k) terms.SetLandmark(k, at.landmarks()[k].position);
  };
  place(graph);
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(options);
  for (std::size_t k = 0; k < graph.nodes().size(); ++k)
    problem.AddParameterBlock(&blocks[k * size], static_cast<int>(size));
  terms.AddTo(problem, blocks.data());
  std::vector<double> gradient;
  problem.Evaluate(ceres::Problem::EvaluateOptions(), nullptr, nullptr, &gradient, nullptr);
  constexpr double kStep = 1e-6;
  double worst = 0;
  for (std::size_t k = 0; k < graph.nodes().size() + graph.landmarks().size(); ++k) {
    const bool node = k < graph.nodes().size();
    const std::size_t l = k - graph.nodes().size();
    const int dimensions = node ? N : internal::MeasurementTerms<N>::kPoint;
    for (int d = 0; d < dimensions; ++d) {
      double cost[2];
      for (const int side : {0, 1}) {
        PoseGraph moved = graph;
        const double step = side == 0 ? -kStep : kStep;
        if (node) {
          Similarity pose = graph.nodes()[k].pose;
          Eigen::Vector3d turn = Eigen::Vector3d::Zero();
          if (N == 3 && d == 2) turn.z() = step;
          if (N == 6 && d >= 3) turn(d - 3) = step;
          if (turn.isZero(0)) pose.translation(d) += step;
          pose.rotation = pose.rotation * ExpSO3(turn);
          moved.SetPose(graph.nodes()[k].id, pose);
        } else {
          moved.SetLandmark(graph.landmarks()[l].id,
                            graph.landmarks()[l].position + step * Eigen::Vector3d::Unit(d));
        }
        place(moved);
        cost[side] = 0.5 * terms.Chi2(blocks.data());
      }
      const double difference = (cost[1] - cost[0]) / (2 * kStep);
      const std::size_t at =
          (node ? k * size : graph.nodes().size() * size + l * static_cast<std::size_t>(dimensions)) +
          static_cast<std::size_t>(d);
      worst = std::max(worst, std::abs(gradient[at] - difference) / (1 + std::abs(difference)));
    }
  }
  return worst;
}

TEST(Measurements, HaveTheGradientsOfTheirCosts) {
  const PoseGraph planar =
      Read(
          "PARAMS_SE2OFFSET 0 0.3 -0.2 0.4\nVERTEX_SE2 0 0 0 0.3\nVERTEX_SE2 1 1 0.5 -0.6\nVERTEX_XY 5 3 2\n"
          "VERTEX_XY 6 4 2\nEDGE_SE2_XY_OFFSET 1 5 0 1 2 3 1 4\nEDGE_BEARING_SE2_XY 1 6 0.2 5\n"
          "EDGE_PRIOR_SE2 1 1 1 0.1 1 0.1 0.2 2 0.1 3\nEDGE_PRIOR_SE2_XY 0 1 1 1 0 1\nEDGE_POINTXY 5 6 1 1 2 "
          "0 1\n"
          "EDGE_PRIOR_XY 5 3 3 1 0 1\n")
          .graph;
  EXPECT_LT(GradientError<3>(planar, GraphObjective::kChi2), 1e-6);
  // One of each tag, with a sensor that is not at the origin of its node.
  const PoseGraph rigid =
      Read(
          "PARAMS_SE3OFFSET 0 0.3 -0.2 0.1 0.1 0.2 0.3 0.9\n"
          "VERTEX_SE3:QUAT 0 0 0 0 0.1 0 0 1\nVERTEX_SE3:QUAT 1 1 0.2 0 0 0.2 0.1 1\n"
          "VERTEX_TRACKXYZ 5 2 1 3\nVERTEX_TRACKXYZ 6 2 1 4\nFIX 0\n"
          "EDGE_SE3_TRACKXYZ 1 5 0 1 2 3 4 1 0 5 1 6\nEDGE_POINTXYZ 5 6 0.1 0 1.2 1 0 0 1 0 1\n"
          "EDGE_SE3_PRIOR 1 0 1 0.5 0 0 0.1 0 1 3 0 0 0 0 1 3 0 0 0 0 3 0 0 0 9 0 0 9 0 9\n"
          "EDGE_SE3_XYZPRIOR 1 0 1 1 1 2 0 0 2 0 2\nEDGE_SE3_PRIORXY 1 3 4 1 0 1\n"
          "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n")
          .graph;
  ASSERT_EQ(rigid.measurements().size(), 5u);
  EXPECT_LT(GradientError<6>(rigid, GraphObjective::kChi2), 1e-6);
  EXPECT_LT(GradientError<6>(rigid, GraphObjective::kChi2Log), 1e-6);
}

TEST(Measurements, EdgesBetweenSensorsAreEdgesBetweenTheirNodes) {
  const std::string sensors = "PARAMS_SE2OFFSET 1 0.5 0 0\nPARAMS_SE2OFFSET 2 0 0.25 1.5707963267948966\n";
  const PoseGraph graph =
      Read(sensors + "EDGE_SE2_OFFSET 0 1 1 2 2 0.25 1.5707963267948966 1 0 0 1 0 1\n").graph;
  ASSERT_EQ(graph.edges().size(), 1u);
  EXPECT_EQ(graph.edges()[0].kind, EdgeKind::kOdometry);
  EXPECT_LT((graph.edges()[0].measurement.translation - Eigen::Vector3d(2.5, 0, 0)).norm(), 1e-12);
}

}  // namespace
}  // namespace tutti
