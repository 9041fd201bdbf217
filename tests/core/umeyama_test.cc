#include "core/umeyama.h"

#include <gtest/gtest.h>

#include <random>

namespace tutti::internal {
namespace {

std::vector<Eigen::Vector3d> SomePoints() {
  std::mt19937_64 random(9);
  std::uniform_real_distribution<double> along(-2, 2);
  std::vector<Eigen::Vector3d> points(10);
  for (Eigen::Vector3d& point : points) point = {along(random), along(random), along(random)};
  return points;
}

TEST(Umeyama, RecoversASimilarity) {
  const Similarity truth(1.7, ExpSO3({0.3, 0.2, -0.5}), {1, -2, 0.5});
  const std::vector<Eigen::Vector3d> b = SomePoints();
  std::vector<Eigen::Vector3d> a = b;
  for (Eigen::Vector3d& point : a) point = truth * point;
  const std::optional<Similarity> found = Umeyama(a, b, true);
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->scale, 1.7, 1e-9);
  EXPECT_LT((found->translation - truth.translation).norm(), 1e-9);
  EXPECT_LT(LogSO3(found->rotation.conjugate() * truth.rotation).norm(), 1e-9);
  EXPECT_EQ(Umeyama(a, b, false)->scale, 1.0);
}

TEST(Umeyama, AMirrorImageIsNotTakenForARotation) {
  const std::vector<Eigen::Vector3d> b = SomePoints();
  std::vector<Eigen::Vector3d> a = b;
  for (Eigen::Vector3d& point : a) point.x() = -point.x();
  EXPECT_NEAR(Umeyama(a, b, true)->rotation.toRotationMatrix().determinant(), 1.0, 1e-12);
}

TEST(Umeyama, WhatDoesNotDetermineARotationHasNoAnswer) {
  const std::vector<Eigen::Vector3d> line = {{0, 0, 1}, {0, 0, 2}, {0, 0, 3}};
  EXPECT_FALSE(Umeyama(line, line, true));
  EXPECT_FALSE(Umeyama({3, Eigen::Vector3d::Ones()}, {3, Eigen::Vector3d::Ones()}, true));
  EXPECT_FALSE(Umeyama({}, {}, true));
  EXPECT_FALSE(Umeyama(SomePoints(), line, true));
}

}  // namespace
}  // namespace tutti::internal
