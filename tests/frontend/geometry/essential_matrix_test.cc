#include "frontend/geometry/two_view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>

#include "core/dense_solvers.h"
#include "tutti/core/pose.h"

namespace tutti::internal {
namespace {

struct RayPairs {
  std::vector<Eigen::Vector2d> first, second;
  Eigen::Matrix3d truth;  // of Frobenius norm 1
};

class RayWorld {
 public:
  explicit RayWorld(unsigned seed) : generator_(seed) {}

  double Uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(generator_()) / static_cast<double>(generator_.max());
  }

  // A motion by up to a metre and half a radian; points in front of both cameras; rays off by up to `noise`.
  RayPairs Seen(int count, double noise) {
    const Pose motion(ExpSO3({Uniform(-0.3, 0.3), Uniform(-0.3, 0.3), Uniform(-0.3, 0.3)}),
                      {Uniform(-1, 1), Uniform(-1, 1), Uniform(-1, 1)});
    RayPairs pairs;
    pairs.truth = Skew(motion.translation) * motion.rotation.toRotationMatrix();
    pairs.truth.normalize();
    while (static_cast<int>(pairs.first.size()) < count) {
      const Eigen::Vector3d p(Uniform(-3, 3), Uniform(-3, 3), Uniform(4, 10)), q = motion * p;
      if (q.z() < 0.5) continue;
      pairs.first.push_back(p.hnormalized() + noise * Eigen::Vector2d(Uniform(-1, 1), Uniform(-1, 1)));
      pairs.second.push_back(q.hnormalized() + noise * Eigen::Vector2d(Uniform(-1, 1), Uniform(-1, 1)));
    }
    return pairs;
  }

 private:
  std::mt19937 generator_;
};

// An essential matrix has no sign.
double Apart(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return std::min((a - b).norm(), (a + b).norm());
}

TEST(FivePointEssential, TheMotionIsAmongItsSolutions) {
  RayWorld world(1);
  int found = 0;
  for (int i = 0; i < 500; ++i) {
    const RayPairs pairs = world.Seen(5, 0);
    Eigen::Matrix<double, 5, 2> a, b;
    for (int k = 0; k < 5; ++k) {
      a.row(k) = pairs.first[static_cast<std::size_t>(k)];
      b.row(k) = pairs.second[static_cast<std::size_t>(k)];
    }
    double nearest = 10;
    for (const Eigen::Matrix3d& e : FivePointEssential(a, b))
      nearest = std::min(nearest, Apart(e, pairs.truth));
    found += nearest < 1e-6 ? 1 : 0;
  }
  EXPECT_GE(found, 495);  // a few samples are nearly degenerate
}

TEST(FivePointEssential, EverySolutionIsAnEssentialMatrixOfThePairs) {
  RayWorld world(2);
  for (int i = 0; i < 100; ++i) {
    Eigen::Matrix<double, 5, 2> a, b;
    for (int k = 0; k < 5; ++k) {
      a.row(k) << world.Uniform(-1, 1), world.Uniform(-1, 1);
      b.row(k) << world.Uniform(-1, 1), world.Uniform(-1, 1);
    }
    for (const Eigen::Matrix3d& e : FivePointEssential(a, b)) {
      const Eigen::Vector3d singular = SingularValues(e).values;
      EXPECT_NEAR(singular(0), singular(1), 1e-6);
      EXPECT_NEAR(singular(2), 0, 1e-6);
      for (int k = 0; k < 5; ++k) {
        const Eigen::Vector2d in_first = a.row(k), in_second = b.row(k);
        EXPECT_NEAR(in_second.homogeneous().dot(e * in_first.homogeneous()), 0, 1e-9);
      }
    }
  }
}

TEST(FivePointEssential, PairsThatAreOneHaveNoSolution) {
  const Eigen::Matrix<double, 5, 2> same = Eigen::Matrix<double, 5, 2>::Constant(0.25);
  EXPECT_TRUE(FivePointEssential(same, same).empty());
  const Eigen::Matrix<double, 5, 2> none = Eigen::Matrix<double, 5, 2>::Constant(NAN);
  EXPECT_TRUE(FivePointEssential(none, none).empty());
}

TEST(FitEssential, FourOutliersInTenPairsDoNotMatter) {
  RayWorld world(3);
  for (int i = 0; i < 20; ++i) {
    RayPairs pairs = world.Seen(200, 0);
    for (std::size_t k = 0; k < 80; ++k) pairs.second[k] = {world.Uniform(-1, 1), world.Uniform(-1, 1)};
    const auto found = FitEssential(pairs.first, pairs.second, 1e-6, 0.9999);
    ASSERT_TRUE(found.has_value());
    EXPECT_GE(found->inliers, 120);
    EXPECT_LT(Apart(found->matrix, pairs.truth), 1e-4) << i;
  }
}

TEST(FitEssential, AsManyInliersAsOpenCvFinds) {
  RayWorld world(4);
  int ours = 0, theirs = 0;
  for (int i = 0; i < 20; ++i) {
    RayPairs pairs = world.Seen(150, 1e-3);
    for (std::size_t k = 0; k < 50; ++k) pairs.second[k] = {world.Uniform(-1, 1), world.Uniform(-1, 1)};
    std::vector<cv::Point2d> first, second;
    for (std::size_t k = 0; k < pairs.first.size(); ++k) {
      first.emplace_back(pairs.first[k].x(), pairs.first[k].y());
      second.emplace_back(pairs.second[k].x(), pairs.second[k].y());
    }
    const auto found = FitEssential(pairs.first, pairs.second, 1.5e-3, 0.9999);
    ASSERT_TRUE(found.has_value());
    ours += found->inliers;
    cv::Mat mask;
    cv::findEssentialMat(first, second, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC, 0.9999, 1.5e-3, mask);
    theirs += cv::countNonZero(mask);
  }
  EXPECT_GE(ours, theirs * 99 / 100);
}

TEST(FitEssential, TooFewPairsOrNoneThatAgreeGiveNone) {
  RayWorld world(5);
  RayPairs pairs = world.Seen(4, 0);
  EXPECT_FALSE(FitEssential(pairs.first, pairs.second, 1e-3, 0.99).has_value());
  const std::vector<Eigen::Vector2d> none(20, Eigen::Vector2d(NAN, NAN));
  EXPECT_FALSE(FitEssential(none, none, 1e-3, 0.99).has_value());
}

}  // namespace
}  // namespace tutti::internal
