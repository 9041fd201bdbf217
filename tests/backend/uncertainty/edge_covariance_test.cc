#include "backend/uncertainty/edge_covariance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/dense_solvers.h"
#include "tests/backend/graph/synthetic_graph.h"

namespace tutti {
namespace {

PoseGraphEdge EdgeOf(const Matrix7d& information) {
  PoseGraphEdge edge;
  edge.information = information;
  return edge;
}

TEST(EdgeCovariance, IsTheInverseOfWhatTheKindUsesOfTheInformation) {
  std::mt19937 random(2);
  const Matrix7d information = testing::RandomInformation(random);
  const Matrix6d spatial =
      internal::EdgeCovariance(EdgeOf(information), GraphKind::kSE3, GraphObjective::kChi2Log);
  EXPECT_LT((spatial * information.topLeftCorner<6, 6>() - Matrix6d::Identity()).norm(), 1e-12);
  const Matrix6d planar =
      internal::EdgeCovariance(EdgeOf(information), GraphKind::kSE2, GraphObjective::kChi2);
  Eigen::Matrix3d used;  // x, y and heading
  used << information(0, 0), information(0, 1), information(0, 5), information(1, 0), information(1, 1),
      information(1, 5), information(5, 0), information(5, 1), information(5, 5);
  const Eigen::Matrix3d expected = used.inverse();
  EXPECT_NEAR(planar(0, 1), expected(0, 1), 1e-12);
  EXPECT_NEAR(planar(1, 5), expected(1, 2), 1e-12);
  EXPECT_NEAR(planar(5, 5), expected(2, 2), 1e-12);
  EXPECT_EQ(planar.block(2, 0, 3, 6).norm(), 0);
}

// The vector part of a quaternion is half of the rotation vector.
TEST(EdgeCovariance, OfTheObjectiveOfG2oIsOfTwiceAsLargeTurns) {
  std::mt19937 random(3);
  const PoseGraphEdge edge = EdgeOf(testing::RandomInformation(random));
  const Matrix6d log = internal::EdgeCovariance(edge, GraphKind::kSE3, GraphObjective::kChi2Log);
  const Matrix6d vector_part = internal::EdgeCovariance(edge, GraphKind::kSE3, GraphObjective::kChi2);
  EXPECT_NEAR(vector_part(1, 2), log(1, 2), 1e-12);
  EXPECT_NEAR(vector_part(1, 4), 2 * log(1, 4), 1e-12);
  EXPECT_NEAR(vector_part(3, 5), 4 * log(3, 5), 1e-12);
}

// By definition: T_a_b Exp(d) = Exp(d') T_a_b, to first order in d.
TEST(Transported, IsTheCovarianceOfThePerturbationInTheOtherFrame) {
  std::mt19937 random(4);
  const Pose T_a_b = testing::RandomPose(GraphKind::kSE3, random, 3.0, 0.8).RigidPart();
  constexpr double kStep = 1e-6;
  Matrix6d jacobian;
  for (int k = 0; k < 6; ++k) {
    Vector6d d = Vector6d::Zero();
    d(k) = kStep;
    jacobian.col(k) = LogSE3(T_a_b * ExpSE3(d) * T_a_b.Inverse()) / kStep;
  }
  const Matrix6d covariance = testing::RandomInformation(random).topLeftCorner<6, 6>();
  const Matrix6d expected = jacobian * covariance * jacobian.transpose();
  EXPECT_LT((internal::Transported(covariance, T_a_b) - expected).norm(), 1e-4 * expected.norm());
}

TEST(Mahalanobis, IsTheSquareOverTheCovarianceOfWhatTheKindUses) {
  std::mt19937 random(5);
  const Matrix6d covariance = testing::RandomInformation(random).topLeftCorner<6, 6>();
  Vector6d d;
  d << 1, -2, 3, 0.5, 0.2, -0.7;
  EXPECT_NEAR(internal::Mahalanobis(d, covariance, GraphKind::kSE3),
              d.dot(internal::SolveLdlt<6>(covariance, d)), 1e-10);
  Matrix6d planar = Matrix6d::Zero();
  planar(0, 0) = 4;
  planar(1, 1) = 0.25;
  planar(5, 5) = 0.01;
  EXPECT_NEAR(internal::Mahalanobis(d, planar, GraphKind::kSE2), 1 / 4.0 + 4 / 0.25 + 0.49 / 0.01, 1e-10);
  EXPECT_EQ(internal::Mahalanobis(d, planar, GraphKind::kSE3), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace tutti
