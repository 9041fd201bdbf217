#include "tutti/core/pose.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tutti {
namespace {

TEST(Pose, ComposesAndInverts) {
  const Pose a(ExpSO3({0.1, -0.4, 2.0}), {1, 2, 3});
  const Pose b(ExpSO3({-1.1, 0.2, 0.3}), {-4, 0.5, 9});
  const Eigen::Vector3d p(0.3, -0.7, 5);
  EXPECT_LT(((a * b) * p - a * (b * p)).norm(), 1e-12);
  EXPECT_LT((a.Inverse() * (a * p) - p).norm(), 1e-12);
  EXPECT_LT(((a * b).Matrix() - a.Matrix() * b.Matrix()).norm(), 1e-12);
}

TEST(Pose, ExpAndLogAreInverseUpToPi) {
  for (double angle : {0.0, 1e-12, 1e-7, 1e-3, 1.0, 3.0, M_PI - 1e-9}) {
    const Eigen::Vector3d v = Eigen::Vector3d(1, -2, 0.5).normalized() * angle;
    EXPECT_LT((LogSO3(ExpSO3(v)) - v).norm(), 1e-8) << angle;
    Vector6d tangent;
    tangent << 4, -5, 6, v;
    EXPECT_LT((LogSE3(ExpSE3(tangent)) - tangent).norm(), 1e-5) << angle;
  }
}

TEST(Pose, RightJacobianInverseMatchesFiniteDifferences) {
  const Eigen::Vector3d v(0.4, -1.2, 0.8);
  const Eigen::Matrix3d j = RightJacobianInverseSO3(v);
  for (int i = 0; i < 3; ++i) {
    Eigen::Vector3d d = Eigen::Vector3d::Zero();
    d(i) = 1e-6;
    const Eigen::Vector3d numeric = (LogSO3(ExpSO3(v) * ExpSO3(d)) - v) / 1e-6;
    EXPECT_LT((numeric - j.col(i)).norm(), 1e-5);
  }
}

TEST(Similarity, ComposesAndInverts) {
  const Similarity a(2.5, ExpSO3({0.1, -0.4, 2.0}), {1, 2, 3});
  const Similarity b(0.3, ExpSO3({-1.1, 0.2, 0.3}), {-4, 0.5, 9});
  const Eigen::Vector3d p(0.3, -0.7, 5);
  EXPECT_LT(((a * b) * p - a * (b * p)).norm(), 1e-12);
  EXPECT_LT((a.Inverse() * (a * p) - p).norm(), 1e-12);
}

}  // namespace
}  // namespace tutti
