#include "frontend/geometry/pose_solver.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "frontend/dataset/rectified_rig.h"

namespace tutti {
namespace {

PinholeCamera SolverCamera() { return Pinhole(500, 510, 322, 238, {640, 480}); }

double Uniform(std::mt19937& generator, double low, double high) {
  return low + (high - low) * static_cast<double>(generator() % 100000) / 1e5;
}

// `count` points in front of a camera that stands at T_camera_world, seen without error.
std::vector<PointObservation> PointsSeen(const Pose& T_camera_world, int count, bool with_depth) {
  std::mt19937 generator(7);
  std::vector<PointObservation> out;
  for (int i = 0; i < count; ++i) {
    const double z = Uniform(generator, 4, 12), y = Uniform(generator, -1.5, 1.5),
                 x = Uniform(generator, -2, 2);
    const Eigen::Vector3d in_camera(x, y, z);
    PointObservation o;
    o.point = T_camera_world.Inverse() * in_camera;
    o.pixel = SolverCamera().Project(in_camera);
    if (with_depth) {
      o.inverse_depth = 1 / in_camera.z();
      o.inverse_depth_sigma = 0.005;
    }
    out.push_back(o);
  }
  return out;
}

const Pose kTruth(ExpSO3({0.1, -0.2, 0.05}), {0.4, -0.3, 0.7});
const Pose kGuess(ExpSO3({0.12, -0.17, 0.04}), {0.3, -0.25, 0.8});

double PoseDistance(const Pose& a, const Pose& b) { return LogSE3(a * b.Inverse()).norm(); }

TEST(ReprojectionResidual, JacobianIsThatOfFiniteDifferences) {
  for (const bool with_depth : {false, true}) {
    for (PointObservation o : PointsSeen(kTruth, 20, with_depth)) {
      o.pixel_sigma = 1.7;
      Eigen::Vector3d at_guess;
      Eigen::Matrix<double, 3, 6> jacobian;
      ASSERT_TRUE(ReprojectionResidual(SolverCamera(), kGuess, o, &at_guess, &jacobian));
      for (int k = 0; k < 6; ++k) {
        constexpr double kStep = 1e-6;
        Eigen::Vector3d plus, minus;
        const Vector6d step = kStep * Vector6d::Unit(k);
        ASSERT_TRUE(ReprojectionResidual(SolverCamera(), ExpSE3(step) * kGuess, o, &plus, nullptr));
        ASSERT_TRUE(ReprojectionResidual(SolverCamera(), ExpSE3(-step) * kGuess, o, &minus, nullptr));
        const Eigen::Vector3d numeric = (plus - minus) / (2 * kStep);
        EXPECT_LT((numeric - jacobian.col(k)).norm(), 1e-4 * (1 + numeric.norm())) << "parameter " << k;
      }
    }
  }
}

TEST(ReprojectionResidual, IsWhitenedAndZeroAtTheTruth) {
  PointObservation o = PointsSeen(kTruth, 1, true)[0];
  Eigen::Vector3d r;
  ASSERT_TRUE(ReprojectionResidual(SolverCamera(), kTruth, o, &r, nullptr));
  EXPECT_LT(r.norm(), 1e-9);
  o.pixel.x() += 3;
  o.pixel_sigma = 2;
  o.inverse_depth -= 0.01;
  ASSERT_TRUE(ReprojectionResidual(SolverCamera(), kTruth, o, &r, nullptr));
  EXPECT_NEAR(std::abs(r.x()), 1.5, 1e-9);
  EXPECT_NEAR(std::abs(r.z()), 2.0, 1e-9);
}

TEST(ReprojectionResidual, PointsBehindTheCameraHaveNone) {
  PointObservation o = PointsSeen(kTruth, 1, false)[0];
  o.point = kTruth.Inverse() * Eigen::Vector3d(0, 0, -5);
  Eigen::Vector3d r;
  EXPECT_FALSE(ReprojectionResidual(SolverCamera(), kTruth, o, &r, nullptr));
}

TEST(RefinePose, FindsThePoseThatExplainsThePixels) {
  for (const bool with_depth : {false, true}) {
    Pose pose = kGuess;
    std::vector<char> inlier;
    EXPECT_EQ(RefinePose(SolverCamera(), PointsSeen(kTruth, 60, with_depth), &pose, &inlier), 60);
    EXPECT_LT(PoseDistance(pose, kTruth), 1e-6);
  }
}

TEST(RefinePose, WrongMatchesAreMarkedAndDoNotMoveThePose) {
  std::vector<PointObservation> observations = PointsSeen(kTruth, 80, false);
  std::mt19937 generator(2);
  for (std::size_t i = 0; i < observations.size(); i += 4) {
    const double dy = Uniform(generator, -80, -20), dx = Uniform(generator, 20, 80);
    observations[i].pixel += Eigen::Vector2d(dx, dy);
  }
  Pose pose = kGuess;
  std::vector<char> inlier;
  EXPECT_EQ(RefinePose(SolverCamera(), observations, &pose, &inlier), 60);
  ASSERT_EQ(inlier.size(), 80U);
  for (std::size_t i = 0; i < inlier.size(); ++i) EXPECT_EQ(inlier[i] != 0, i % 4 != 0) << i;
  EXPECT_LT(PoseDistance(pose, kTruth), 1e-3);
}

TEST(RefinePose, NoObservationsAndPointsBehindLeaveThePoseFinite) {
  Pose pose = kGuess;
  std::vector<char> inlier;
  EXPECT_EQ(RefinePose(SolverCamera(), {}, &pose, &inlier), 0);
  EXPECT_LT(PoseDistance(pose, kGuess), 1e-12);
  std::vector<PointObservation> behind = PointsSeen(kTruth, 30, false);
  for (PointObservation& o : behind) o.point = kTruth.Inverse() * Eigen::Vector3d(0.1, 0.1, -3);
  EXPECT_EQ(RefinePose(SolverCamera(), behind, &pose, &inlier), 0);
  EXPECT_TRUE(pose.IsFinite());
}

TEST(RefinePose, OnePointSeenManyTimesIsDegenerateButFinite) {
  std::vector<PointObservation> observations(40, PointsSeen(kTruth, 1, false)[0]);
  Pose pose = kGuess;
  std::vector<char> inlier;
  RefinePose(SolverCamera(), observations, &pose, &inlier);
  EXPECT_TRUE(pose.IsFinite());
}

struct PointsAndPixels {
  std::vector<Eigen::Vector3d> points;
  std::vector<cv::Point2f> pixels;
};

PointsAndPixels PnpProblem(int count) {
  PointsAndPixels out;
  for (const PointObservation& o : PointsSeen(kTruth, count, false)) {
    out.points.push_back(o.point);
    out.pixels.emplace_back(static_cast<float>(o.pixel.x()), static_cast<float>(o.pixel.y()));
  }
  return out;
}

TEST(SolvePnp, FindsThePoseAmongOutliersWithoutAGuess) {
  PointsAndPixels p = PnpProblem(60);
  for (std::size_t i = 0; i < 60; i += 3) p.pixels[i] += cv::Point2f(90, -70);
  const std::optional<Pose> pose = SolvePnp(SolverCamera(), p.points, p.pixels, 30);
  ASSERT_TRUE(pose);
  EXPECT_LT(PoseDistance(*pose, kTruth), 0.01);
  EXPECT_FALSE(SolvePnp(SolverCamera(), p.points, p.pixels, 41)) << "40 are inliers";
}

TEST(SolvePnp, TooFewOrDegeneratePointsHaveNoPose) {
  for (const int count : {0, 1, 3}) {
    const PointsAndPixels p = PnpProblem(count);
    EXPECT_FALSE(SolvePnp(SolverCamera(), p.points, p.pixels, 4)) << count;
  }
  const std::vector<Eigen::Vector3d> nowhere(
      20, Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(SolvePnp(SolverCamera(), nowhere, PnpProblem(20).pixels, 4));
}

}  // namespace
}  // namespace tutti
