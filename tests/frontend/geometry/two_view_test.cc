#include "frontend/geometry/two_view.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/support/plain_camera.h"

namespace tutti {
namespace {

PinholeCamera Camera() { return testing::PlainCamera(500); }

const Pose kMotion(ExpSO3({0.01, -0.06, 0.02}), {-0.9, 0.1, 0.3});  // T_second_first

struct Matches {
  std::vector<cv::Point2f> first, second;
  std::vector<Eigen::Vector3d> points;
};

// Points in a box, or on one slanted plane; `noise_px` on both pixels.
Matches Scene(const Pose& T_second_first, bool planar, int count, double noise_px) {
  std::mt19937 generator(5);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(generator() % 100000) / 1e5;
  };
  const auto pixel = [&](const Eigen::Vector3d& p) {
    const Eigen::Vector2d u = Camera().Project(p);
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
  const Matches m = Scene(kMotion, false, 200, 0);
  const TwoViewResult result = EstimateTwoView(Camera(), m.first, m.second, TwoViewOptions());
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
  const Matches m = Scene(kMotion, true, 200, 0.3);
  const TwoViewResult result = EstimateTwoView(Camera(), m.first, m.second, TwoViewOptions());
  // A plane may leave two motions that explain it equally well: then it must refuse, not guess.
  if (!result.success) {
    EXPECT_FALSE(result.reason.empty());
    return;
  }
  ExpectMotion(result, 0.05);
}

TEST(EstimateTwoView, WrongMatchesDoNotDisturb) {
  Matches m = Scene(kMotion, false, 240, 0.3);
  for (std::size_t i = 0; i < m.second.size(); i += 4) m.second[i] = m.first[(i + 77) % m.first.size()];
  ExpectMotion(EstimateTwoView(Camera(), m.first, m.second, TwoViewOptions()), 0.05);
}

TEST(EstimateTwoView, RotationAloneHasNoParallaxAndSaysSo) {
  const Matches m = Scene(Pose(ExpSO3({0, 0.1, 0}), Eigen::Vector3d::Zero()), false, 200, 0.3);
  const TwoViewResult result = EstimateTwoView(Camera(), m.first, m.second, TwoViewOptions());
  EXPECT_FALSE(result.success);
  EXPECT_FALSE(result.reason.empty());
}

TEST(EstimateTwoView, FewOrIdenticalOrUnequalMatchesAreRefused) {
  const Matches few = Scene(kMotion, false, 5, 0);
  EXPECT_FALSE(EstimateTwoView(Camera(), few.first, few.second, TwoViewOptions()).success);
  EXPECT_FALSE(EstimateTwoView(Camera(), {}, {}, TwoViewOptions()).success);
  const std::vector<cv::Point2f> same(100, cv::Point2f(100, 100));
  EXPECT_FALSE(EstimateTwoView(Camera(), same, same, TwoViewOptions()).success);
}

TEST(EstimateTwoView, SameInputGivesTheSameBits) {
  const Matches m = Scene(kMotion, false, 150, 0.5);
  const TwoViewResult a = EstimateTwoView(Camera(), m.first, m.second, TwoViewOptions());
  const TwoViewResult b = EstimateTwoView(Camera(), m.first, m.second, TwoViewOptions());
  ASSERT_TRUE(a.success);
  EXPECT_EQ(a.T_second_first.Matrix(), b.T_second_first.Matrix());
  EXPECT_EQ(a.valid, b.valid);
}

}  // namespace
}  // namespace tutti
