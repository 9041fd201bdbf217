#include "core/reprojection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace tutti::internal {
namespace {

constexpr double kMinDepth = 1e-3;

PinholeCamera Camera() {
  PinholeCamera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 500;
  camera.fy = 510;
  camera.cx = 322;
  camera.cy = 238;
  return camera;
}

const Pose kPose(ExpSO3({0.1, -0.2, 0.05}), {0.4, -0.3, 0.7});
const std::vector<Eigen::Vector3d> kPoints = {{0, 0, 1}, {0.3, -0.2, 2.5}, {-4, 3, 6}, {12, 9, 80}};

template <int N>
typename Reprojection<N>::Measurement Measured() {
  typename Reprojection<N>::Measurement measured;
  measured.value.setConstant(0.3);
  measured.value.template head<2>() = Eigen::Vector2d(300, 250);
  measured.weight.setConstant(20);
  measured.weight.template head<2>() = Eigen::Vector2d(1 / 1.7, 1 / 0.6);
  return measured;
}

template <int N>
Eigen::Matrix<double, N, 1> ResidualOf(const Eigen::Vector3d& point) {
  Eigen::Matrix<double, N, 1> r;
  EXPECT_TRUE(Reprojection<N>::Residual(Camera(), point, Measured<N>(), kMinDepth, &r, nullptr));
  return r;
}

// Both Jacobians at a point of the world against central differences.
template <int N>
void ExpectTheJacobiansOfDifferences(const Eigen::Vector3d& world) {
  constexpr double kStep = 1e-6;
  const Eigen::Vector3d p = kPose * world;
  Eigen::Matrix<double, N, 1> r;
  typename Reprojection<N>::PointJacobian by_point;
  ASSERT_TRUE(Reprojection<N>::Residual(Camera(), p, Measured<N>(), kMinDepth, &r, &by_point));
  const typename Reprojection<N>::PoseJacobian by_pose = Reprojection<N>::ByPose(by_point, p);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(k);
    const Eigen::Matrix<double, N, 1> numeric =
        (ResidualOf<N>(p + step) - ResidualOf<N>(p - step)) / (2 * kStep);
    EXPECT_LT((numeric - by_point.col(k)).norm(), 1e-6 * (1 + numeric.norm())) << "coordinate " << k;
  }
  for (int k = 0; k < 6; ++k) {
    const Vector6d step = kStep * Vector6d::Unit(k);
    const Eigen::Matrix<double, N, 1> numeric =
        (ResidualOf<N>(ExpSE3(step) * kPose * world) - ResidualOf<N>(ExpSE3(-step) * kPose * world)) /
        (2 * kStep);
    EXPECT_LT((numeric - by_pose.col(k)).norm(), 1e-6 * (1 + numeric.norm())) << "parameter " << k;
  }
}

TEST(Reprojection, JacobiansAreThoseOfCentralDifferences) {
  for (const Eigen::Vector3d& in_camera : kPoints) {
    const Eigen::Vector3d world = kPose.Inverse() * in_camera;
    ExpectTheJacobiansOfDifferences<2>(world);
    ExpectTheJacobiansOfDifferences<3>(world);
  }
}

TEST(Reprojection, ResidualIsSeenMinusMeasuredInSigmas) {
  const Eigen::Vector3d point(0.3, -0.2, 2.5);
  Reprojection<3>::Measurement measured;
  const Eigen::Vector2d pixel = Camera().Project(point);
  measured.value << pixel.x() - 3, pixel.y() + 4, 1 / 2.5 - 0.01;
  measured.weight << 0.5, 0.25, 200;
  Eigen::Vector3d r;
  ASSERT_TRUE(Reprojection<3>::Residual(Camera(), point, measured, kMinDepth, &r, nullptr));
  EXPECT_LT((r - Eigen::Vector3d(1.5, -1, 2)).norm(), 1e-9);
}

TEST(Reprojection, WithoutDepthTwoRowsAndThreeWithWeightZeroAgree) {
  for (const Eigen::Vector3d& point : kPoints) {
    Reprojection<3>::Measurement measured = Measured<3>();
    measured.weight(2) = 0;
    Eigen::Vector3d r;
    Reprojection<3>::PointJacobian by_point;
    ASSERT_TRUE(Reprojection<3>::Residual(Camera(), point, measured, kMinDepth, &r, &by_point));
    EXPECT_EQ(r.head<2>(), ResidualOf<2>(point));
    EXPECT_EQ(r(2), 0);
    EXPECT_EQ(by_point.row(2), Eigen::RowVector3d::Zero());
  }
}

TEST(Reprojection, NoResidualBehindTheCameraInItsPlaneOrNearerThanTheLeastDepth) {
  const Eigen::Vector2d before(7, 8);
  Eigen::Vector2d r = before;
  Reprojection<2>::PointJacobian by_point;
  for (const double z :
       {-5.0, -1e-9, 0.0, 0.5 * kMinDepth, kMinDepth, std::numeric_limits<double>::quiet_NaN(),
        -std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(Reprojection<2>::Residual(Camera(), {0.1, 0.2, z}, Measured<2>(), kMinDepth, &r, &by_point))
        << z;
    EXPECT_EQ(r, before) << z;
  }
}

TEST(Reprojection, PointAtInfinityTellsOfTheRotationAlone) {
  const Eigen::Vector3d far(1e12, -2e12, 1e13);
  Eigen::Vector3d r;
  Reprojection<3>::PointJacobian by_point;
  ASSERT_TRUE(Reprojection<3>::Residual(Camera(), far, Measured<3>(), kMinDepth, &r, &by_point));
  EXPECT_TRUE(r.allFinite());
  EXPECT_LT(by_point.norm(), 1e-9);
  const Reprojection<3>::PoseJacobian by_pose = Reprojection<3>::ByPose(by_point, far);
  EXPECT_TRUE(by_pose.allFinite());
  EXPECT_GT(by_pose.rightCols<3>().norm(), 100);
}

TEST(Reprojection, NotANumberBesideTheAxisStaysOne) {
  Eigen::Vector2d r;
  ASSERT_TRUE(Reprojection<2>::Residual(Camera(), {NAN, 0, 2}, Measured<2>(), kMinDepth, &r, nullptr));
  EXPECT_TRUE(std::isnan(r.x()));
  EXPECT_TRUE(std::isfinite(r.y()));
}

}  // namespace
}  // namespace tutti::internal
