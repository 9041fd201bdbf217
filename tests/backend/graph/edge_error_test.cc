#include "backend/graph/edge_error.h"

#include <gtest/gtest.h>

#include "backend/graph/manifold.h"
#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

using internal::EdgeError;

// Moves a block along one tangent direction as the solver does.
template <int N>
void Step(const double* block, int direction, double h, double* out) {
  double delta[7] = {0, 0, 0, 0, 0, 0, 0};
  delta[direction] = h;
  if constexpr (N == 3) {
    for (int i = 0; i < 3; ++i) out[i] = block[i] + delta[i];
  } else {
    ASSERT_TRUE(internal::NodeManifold<N - 3>().Plus(block, delta, out));
  }
}

template <int N>
Eigen::Matrix<double, N, 1> Error(const EdgeError<N>& c, const double* i, const double* j) {
  Eigen::Matrix<double, N, 1> error;
  c.Evaluate(i, j, error, nullptr, nullptr);
  return error;
}

template <int N>
void CheckJacobians(GraphKind kind, GraphObjective objective, double rotation, double translation) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 20; ++trial) {
    PoseGraphEdge edge;
    edge.measurement = testing::RandomPose(kind, random, 3.0, rotation);
    const EdgeError<N> c(edge, objective);
    double block[2][8], moved[8];
    for (double* b : {block[0], block[1]})
      internal::PoseToBlock<N>(testing::RandomPose(kind, random, translation, rotation), b);
    Eigen::Matrix<double, N, 1> error;
    Eigen::Matrix<double, N, N> analytic[2];
    c.Evaluate(block[0], block[1], error, &analytic[0], &analytic[1]);
    const double h = 1e-6 * std::max(1.0, translation / 1e3);
    for (int end = 0; end < 2; ++end) {
      for (int d = 0; d < N; ++d) {
        Eigen::Matrix<double, N, 1> plus, minus;
        Step<N>(block[end], d, h, moved);
        plus = end == 0 ? Error<N>(c, moved, block[1]) : Error<N>(c, block[0], moved);
        Step<N>(block[end], d, -h, moved);
        minus = end == 0 ? Error<N>(c, moved, block[1]) : Error<N>(c, block[0], moved);
        const Eigen::Matrix<double, N, 1> numeric = (plus - minus) / (2 * h);
        const double size = std::max(1.0, analytic[end].col(d).norm());
        EXPECT_LT((numeric - analytic[end].col(d)).norm(), 1e-6 * size)
            << "trial " << trial << " end " << end << " direction " << d;
      }
    }
  }
}

TEST(EdgeError, JacobiansMatchFiniteDifferencesAlsoFarFromTheOrigin) {
  for (const double translation : {5.0, 1e6}) {
    CheckJacobians<3>(GraphKind::kSE2, GraphObjective::kChi2, 0.7, translation);
    for (const GraphObjective objective : {GraphObjective::kChi2, GraphObjective::kChi2Log})
      CheckJacobians<6>(GraphKind::kSE3, objective, 0.7, translation);
  }
  for (const GraphObjective objective : {GraphObjective::kChi2, GraphObjective::kChi2Log})
    CheckJacobians<7>(GraphKind::kSim3, objective, 0.7, 5.0);
}

TEST(EdgeError, JacobiansHoldCloseToHalfATurn) {
  PoseGraphEdge edge;
  const EdgeError<6> c(edge, GraphObjective::kChi2Log);
  double i[7], j[7], moved[7];
  internal::PoseToBlock<6>(Similarity(), i);
  internal::PoseToBlock<6>(Similarity(1, ExpSO3({M_PI - 1e-3, 0, 0}), {1, 2, 3}), j);
  Eigen::Matrix<double, 6, 1> error;
  Eigen::Matrix<double, 6, 6> Ji, Jj;
  c.Evaluate(i, j, error, &Ji, &Jj);
  EXPECT_TRUE(Ji.allFinite() && Jj.allFinite());
  for (int d = 0; d < 6; ++d) {
    Step<6>(j, d, 1e-6, moved);
    EXPECT_LT(((Error<6>(c, i, moved) - error) / 1e-6 - Jj.col(d)).norm(), 1e-3);
  }
}

TEST(EdgeError, PlanarHeadingsOnBothSidesOfHalfATurnAreTheSame) {
  PoseGraphEdge edge;
  edge.measurement.rotation = ExpSO3({0, 0, M_PI});
  const EdgeError<3> c(edge, GraphObjective::kChi2);
  const double i[3] = {0, 0, 0};
  for (const double heading : {M_PI - 1e-9, M_PI, -M_PI, -M_PI + 1e-9, 7 * M_PI}) {
    const double j[3] = {0, 0, heading};
    EXPECT_LT(Error<3>(c, i, j).norm(), 2e-9) << heading;
  }
}

template <int N>
void CheckWhitenedJacobians(GraphKind kind) {
  std::mt19937 random(9);
  PoseGraphEdge edge;
  edge.measurement = testing::RandomPose(kind, random, 3.0, 0.7);
  edge.information = testing::RandomInformation(random);
  const EdgeError<N> c(edge, GraphObjective::kChi2Log);
  double block[2][8], moved[8];
  for (double* b : {block[0], block[1]})
    internal::PoseToBlock<N>(testing::RandomPose(kind, random, 5, 0.7), b);
  const internal::LinearizedEdge<N> edge_at = c.Linearized(block[0], block[1]);
  const auto chi2 = [&](int end) {
    return (c.sqrt_information * (end == 0 ? Error<N>(c, moved, block[1]) : Error<N>(c, block[0], moved)))
        .squaredNorm();
  };
  constexpr double h = 1e-6;
  for (int end = 0; end < 2; ++end) {
    const Eigen::Matrix<double, N, 1> gradient = 2 * edge_at.jacobian[end].transpose() * edge_at.error;
    for (int d = 0; d < N; ++d) {
      Step<N>(block[end], d, h, moved);
      const double plus = chi2(end);
      Step<N>(block[end], d, -h, moved);
      EXPECT_NEAR(gradient(d), (plus - chi2(end)) / (2 * h), 1e-5 * (1 + gradient.norm())) << ToString(kind);
    }
  }
}

TEST(EdgeError, GradientsWithOffDiagonalInformationMatchFiniteDifferences) {
  CheckWhitenedJacobians<3>(GraphKind::kSE2);
  CheckWhitenedJacobians<6>(GraphKind::kSE3);
  CheckWhitenedJacobians<7>(GraphKind::kSim3);
}

TEST(EdgeError, IsZeroWhereTheMeasurementHolds) {
  std::mt19937 random(3);
  const Similarity a = testing::RandomPose(GraphKind::kSim3, random, 3, 1),
                   b = testing::RandomPose(GraphKind::kSim3, random, 3, 1);
  PoseGraphEdge edge;
  edge.measurement = a.Inverse() * b;
  double i[8], j[8];
  internal::PoseToBlock<7>(a, i);
  internal::PoseToBlock<7>(b, j);
  EXPECT_LT(Error<7>(EdgeError<7>(edge, GraphObjective::kChi2Log), i, j).norm(), 1e-12);
}

// The trap: S = L^T, not L. With off-diagonal terms the two give different costs.
TEST(EdgeError, WhitenedErrorHasTheChiSquareOfTheFullInformationMatrix) {
  std::mt19937 random(5);
  PoseGraph graph(GraphKind::kSim3);
  graph.AddNode(0, testing::RandomPose(GraphKind::kSim3, random, 1, 0.5));
  graph.AddNode(1, testing::RandomPose(GraphKind::kSim3, random, 1, 0.5));
  const Matrix7d information = testing::RandomInformation(random);
  graph.AddLoop(0, 1, testing::RandomPose(GraphKind::kSim3, random, 1, 0.5), information);
  const PoseGraphEdge& edge = graph.edges()[0];
  const Similarity E = edge.measurement.Inverse() * graph.Node(0).pose.Inverse() * graph.Node(1).pose;
  Vector7d e;
  e << E.translation, LogSO3(E.rotation), std::log(E.scale);
  EXPECT_NEAR(EdgeChi2(graph, edge, GraphObjective::kChi2Log), e.dot(information * e), 1e-9);
  e.segment<3>(3) = (E.rotation.w() < 0 ? -1.0 : 1.0) * E.rotation.vec();
  EXPECT_NEAR(EdgeChi2(graph, edge, GraphObjective::kChi2), e.dot(information * e), 1e-9);
}

TEST(NodeManifold, MinusInvertsPlus) {
  std::mt19937 random(2);
  double x[8], y[8], delta[7] = {0.1, -0.2, 0.3, 0.05, -0.4, 0.5, 0.6}, back[7];
  internal::PoseToBlock<7>(testing::RandomPose(GraphKind::kSim3, random, 2, 1), x);
  const internal::NodeManifold<4> manifold;
  ASSERT_TRUE(manifold.Plus(x, delta, y));
#if TUTTI_CERES_HAS_MANIFOLD
  ASSERT_TRUE(manifold.Minus(y, x, back));
  for (int k = 0; k < 7; ++k) EXPECT_NEAR(back[k], delta[k], 1e-12);
#else
  (void)back;
#endif
}

}  // namespace
}  // namespace tutti
