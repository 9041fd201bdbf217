#include "frontend/geometry/two_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "frontend/map/window_solver.h"
#include "tests/support/plain_camera.h"

namespace tutti {
namespace {

PinholeCamera TwoViewCamera() { return testing::PlainCamera(500); }

const Pose kMotion(ExpSO3({0.01, -0.06, 0.02}), {-0.9, 0.1, 0.3});  // T_second_first

struct Matches {
  std::vector<cv::Point2f> first, second;
  std::vector<Eigen::Vector3d> points;
};

// Points in a box, or on one slanted plane; `noise_px` on both pixels.
Matches MatchedScene(const Pose& T_second_first, bool planar, int count, double noise_px) {
  std::mt19937 generator(5);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(generator() % 100000) / 1e5;
  };
  const auto pixel = [&](const Eigen::Vector3d& p) {
    const Eigen::Vector2d u = TwoViewCamera().Project(p);
    const double dy = uniform(-noise_px, noise_px), dx = uniform(-noise_px, noise_px);
    return cv::Point2f(static_cast<float>(u.x() + dx), static_cast<float>(u.y() + dy));
  };
  Matches matches;
  for (int i = 0; i < count; ++i) {
    const double x = uniform(-3, 3), y = uniform(-2, 2);
    const Eigen::Vector3d p(x, y, planar ? 8 + 0.4 * x - 0.2 * y : uniform(6, 14));
    matches.points.push_back(p);
    matches.first.push_back(pixel(p));
    matches.second.push_back(pixel(T_second_first * p));
  }
  return matches;
}

TwoViewResult Estimate(const Matches& m) {
  return EstimateTwoView(TwoViewCamera(), m.first, m.second, TwoViewOptions());
}

void ExpectMotion(const TwoViewResult& result, double tolerance) {
  ASSERT_TRUE(result.success) << result.reason;
  EXPECT_NEAR(result.T_second_first.translation.norm(), 1, 1e-9);
  EXPECT_LT((result.T_second_first.translation - kMotion.translation.normalized()).norm(), tolerance);
  EXPECT_LT(LogSO3(result.T_second_first.rotation.conjugate() * kMotion.rotation).norm(), tolerance);
}

TEST(Triangulate, MeetsThePointOfTwoRays) {
  const Eigen::Vector3d point(0.5, -0.4, 7);
  const Eigen::Vector3d in_second = kMotion * point;
  EXPECT_LT((Triangulate(point / point.z(), in_second / in_second.z(), kMotion) - point).norm(), 1e-9);
}

TEST(EstimateTwoView, BoxOfPointsGivesMotionAndPoints) {
  const Matches m = MatchedScene(kMotion, false, 200, 0);
  const TwoViewResult result = Estimate(m);
  ExpectMotion(result, 2e-3);
  EXPECT_FALSE(result.homography);
  EXPECT_GT(result.parallax_deg, 3);
  int valid = 0;
  for (std::size_t i = 0; i < m.points.size(); ++i) {
    if (!result.valid[i]) continue;
    ++valid;
    const Eigen::Vector3d scaled = result.points[i] * kMotion.translation.norm();
    EXPECT_LT((scaled - m.points[i]).norm(), 0.05 * m.points[i].norm());
  }
  EXPECT_GT(valid, 180);
}

TEST(EstimateTwoView, PlaneGivesTheMotionByItsHomography) {
  const TwoViewResult result = Estimate(MatchedScene(kMotion, true, 200, 0.3));
  // A plane may leave two motions that explain it equally well: then it must refuse, not guess.
  if (!result.success) {
    EXPECT_FALSE(result.reason.empty());
    return;
  }
  ExpectMotion(result, 0.05);
}

TEST(EstimateTwoView, WrongMatchesDoNotDisturb) {
  Matches m = MatchedScene(kMotion, false, 240, 0.3);
  for (std::size_t i = 0; i < m.second.size(); i += 4) m.second[i] = m.first[(i + 77) % m.first.size()];
  ExpectMotion(Estimate(m), 0.05);
}

TEST(EstimateTwoView, RotationAloneHasNoParallaxAndSaysSo) {
  const Pose turn(ExpSO3({0, 0.1, 0}), Eigen::Vector3d::Zero());
  const TwoViewResult result = Estimate(MatchedScene(turn, false, 200, 0.3));
  EXPECT_FALSE(result.success);
  EXPECT_FALSE(result.reason.empty());
}

TEST(EstimateTwoView, FewOrIdenticalOrUnequalMatchesAreRefused) {
  const std::vector<cv::Point2f> same(100, cv::Point2f(100, 100));
  for (const Matches& m : {MatchedScene(kMotion, false, 5, 0), Matches(), Matches{same, same, {}}})
    EXPECT_FALSE(Estimate(m).success) << m.first.size();
}

TEST(EstimateTwoView, SameInputGivesTheSameBits) {
  const Matches m = MatchedScene(kMotion, false, 150, 0.5);
  const TwoViewResult a = Estimate(m), b = Estimate(m);
  ASSERT_TRUE(a.success);
  EXPECT_EQ(a.T_second_first.Matrix(), b.T_second_first.Matrix());
  EXPECT_EQ(a.valid, b.valid);
}

std::vector<TwoViewPoint> SeenTwice(const std::vector<Eigen::Vector3d>& points, double sigma_px) {
  std::vector<TwoViewPoint> seen;
  seen.reserve(points.size());
  for (const Eigen::Vector3d& p : points) seen.push_back({p, sigma_px, sigma_px});
  return seen;
}

// The direction's error in the best fit to pixels with noise, root mean square of its two components.
double DirectionError(const std::vector<Eigen::Vector3d>& points, double sigma_px, int trials) {
  std::mt19937 generator(3);
  const auto uniform = [&] { return static_cast<double>(generator() % 100000) / 1e5; };
  const auto noise = [&] {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += uniform();
    return Eigen::Vector2d(sigma_px * sum, 0);
  };
  double squared = 0;
  for (int trial = 0; trial < trials; ++trial) {
    Window window;
    window.moving = 1;
    window.T_camera_world = {kMotion, Pose()};
    window.points = points;
    window.first_observation.push_back(0);
    for (const Eigen::Vector3d& p : points) {
      for (int camera = 0; camera < 2; ++camera) {
        WindowObservation o;
        o.camera = camera;
        o.measured.pixel_sigma = sigma_px;
        const Eigen::Vector2d across = noise(), down = noise();
        o.measured.pixel =
            TwoViewCamera().Project(camera == 0 ? kMotion * p : p) + Eigen::Vector2d(across.x(), down.x());
        window.observations.push_back(o);
      }
      window.first_observation.push_back(window.observations.size());
    }
    EXPECT_TRUE(SolveWindow(TwoViewCamera(), 20, &window).usable);
    const Eigen::Vector3d found = window.T_camera_world[0].Inverse().translation.normalized();
    squared += (found - kMotion.Inverse().translation.normalized()).squaredNorm();
  }
  return std::sqrt(squared / trials);
}

TEST(DirectionSigma, IsWhatNoiseDoesToTheDirection) {
  const std::vector<Eigen::Vector3d> points = MatchedScene(kMotion, false, 100, 0).points;
  const double sigma = DirectionSigma(TwoViewCamera(), kMotion, SeenTwice(points, 0.5));
  // The larger one of two components is returned: the error of both is 1 to 1.41 times as much.
  const double error = DirectionError(points, 0.5, 60);
  EXPECT_GT(error, 0.8 * sigma);
  EXPECT_LT(error, 1.6 * sigma);
}

TEST(DirectionSigma, GrowsWithTheNoiseAndNotWithTheUnitOfLength) {
  const std::vector<Eigen::Vector3d> points = MatchedScene(kMotion, false, 100, 0).points;
  const double sigma = DirectionSigma(TwoViewCamera(), kMotion, SeenTwice(points, 0.5));
  EXPECT_NEAR(DirectionSigma(TwoViewCamera(), kMotion, SeenTwice(points, 1)), 2 * sigma, 1e-6 * sigma);
  std::vector<Eigen::Vector3d> larger;
  larger.reserve(points.size());
  for (const Eigen::Vector3d& p : points) larger.emplace_back(10 * p);
  const Pose longer(kMotion.rotation, 10 * kMotion.translation);
  EXPECT_NEAR(DirectionSigma(TwoViewCamera(), longer, SeenTwice(larger, 0.5)), sigma, 1e-6 * sigma);
  const Pose shorter(kMotion.rotation, 0.1 * kMotion.translation);
  EXPECT_GT(DirectionSigma(TwoViewCamera(), shorter, SeenTwice(points, 0.5)), 5 * sigma);
}

TEST(DirectionSigma, IsInfiniteWhereTheMotionIsOpen) {
  const std::vector<Eigen::Vector3d> points = MatchedScene(kMotion, false, 100, 0).points;
  const Pose turn(kMotion.rotation, Eigen::Vector3d::Zero());
  EXPECT_EQ(DirectionSigma(TwoViewCamera(), turn, SeenTwice(points, 0.5)), INFINITY);
  EXPECT_EQ(DirectionSigma(TwoViewCamera(), kMotion, SeenTwice({points[0], points[1]}, 0.5)), INFINITY);
  EXPECT_EQ(DirectionSigma(TwoViewCamera(), kMotion, {}), INFINITY);
}

}  // namespace
}  // namespace tutti
