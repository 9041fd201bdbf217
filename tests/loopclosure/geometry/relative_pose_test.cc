#include "tutti/loopclosure/relative_pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "core/dense_solvers.h"

namespace tutti {
namespace {

PinholeCamera Camera() {
  PinholeCamera camera;
  camera.width = 640;
  camera.height = 480;
  camera.fx = camera.fy = 520;
  camera.cx = 318;
  camera.cy = 236;
  return camera;
}

class Scene {
 public:
  explicit Scene(std::uint32_t seed) : generator_(seed) {}
  double Uniform(double low, double high) { return low + (high - low) * (generator_() % 1000000u) / 1e6; }
  double Noise(double sigma) {  // sum of uniforms: the same numbers with every standard library
    double sum = 0;
    for (int i = 0; i < 12; ++i) sum += Uniform(0, 1);
    return sigma * (sum - 6);
  }
  Eigen::Vector3d Point() { return {Uniform(-1.5, 1.5), Uniform(-1, 1), Uniform(2, 5)}; }
  Eigen::Vector2d Pixel(const Eigen::Vector3d& p, double sigma) {
    const double dy = Noise(sigma), dx = Noise(sigma);
    return Camera().Project(p) + Eigen::Vector2d(dx, dy);
  }
  Eigen::Vector2d AnyPixel() {
    const double y = Uniform(0, 480), x = Uniform(0, 640);
    return {x, y};
  }

 private:
  std::mt19937 generator_;
};

const Pose kTrueQueryCandidate(ExpSO3({0.05, -0.1, 0.03}), {0.2, -0.1, 0.15});  // T_query_candidate

struct PnpData {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
};

PnpData MakePnp(int inliers, int outliers, double sigma, std::uint32_t seed) {
  Scene scene(seed);
  PnpData data;
  for (int i = 0; i < inliers + outliers; ++i) {
    const Eigen::Vector3d p = scene.Point();
    data.points.push_back(p);
    data.pixels.push_back(i < inliers ? scene.Pixel(kTrueQueryCandidate * p, sigma) : scene.AnyPixel());
  }
  return data;
}

TEST(SolvePnp, FindsThePoseExactlyWithoutNoise) {
  const PnpData data = MakePnp(30, 0, 0, 1);
  const PnpResult result = SolvePnp(data.points, data.pixels, Camera(), {});
  ASSERT_TRUE(result.success) << result.reason;
  EXPECT_EQ(result.inliers.size(), 30u);
  EXPECT_LT(LogSE3(result.T_camera_points.Inverse() * kTrueQueryCandidate).norm(), 1e-6);
}

TEST(SolvePnp, SurvivesHalfOutliersAndNoise) {
  const PnpData data = MakePnp(80, 80, 1.0, 2);
  const PnpResult result = SolvePnp(data.points, data.pixels, Camera(), {});
  ASSERT_TRUE(result.success) << result.reason;
  EXPECT_GE(result.inliers.size(), 65u);
  const Vector6d error = LogSE3(result.T_camera_points.Inverse() * kTrueQueryCandidate);
  EXPECT_LT(error.head<3>().norm(), 0.02);
  EXPECT_LT(error.tail<3>().norm(), 0.006);
}

TEST(SolvePnp, SaysWhyItFails) {
  const PnpData few = MakePnp(3, 0, 0, 3);
  EXPECT_NE(SolvePnp(few.points, few.pixels, Camera(), {}).reason.find("only 3 matches"), std::string::npos);
  const PnpData wrong = MakePnp(0, 60, 0, 4);
  RelativePoseOptions options;
  options.min_inliers = 15;
  const PnpResult result = SolvePnp(wrong.points, wrong.pixels, Camera(), options);
  EXPECT_FALSE(result.success);
  EXPECT_NE(result.reason.find("inliers"), std::string::npos) << result.reason;
  EXPECT_FALSE(SolvePnp(few.points, {}, Camera(), {}).reason.empty());
}

TEST(SolvePnp, IsDeterministicForASeed) {
  const PnpData data = MakePnp(40, 60, 1.0, 5);
  const PnpResult a = SolvePnp(data.points, data.pixels, Camera(), {});
  const PnpResult b = SolvePnp(data.points, data.pixels, Camera(), {});
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.T_camera_points.Matrix(), b.T_camera_points.Matrix());
  EXPECT_EQ(a.information, b.information);
}

// The covariance that the information promises is that of the errors: the mean of e^T I e is 6 over many
// noisy scenes.
TEST(SolvePnp, InformationMatchesTheScatterOfTheErrors) {
  RelativePoseOptions options;
  options.pixel_sigma = 0.5;
  double sum = 0;
  constexpr int kScenes = 60;
  for (std::uint32_t seed = 0; seed < kScenes; ++seed) {
    const PnpData data = MakePnp(60, 0, 0.5, 100 + seed);
    const PnpResult result = SolvePnp(data.points, data.pixels, Camera(), options);
    ASSERT_TRUE(result.success);
    const Vector6d error = LogSE3(result.T_camera_points * kTrueQueryCandidate.Inverse());
    // error of T_points_camera: T_est = T_true * Exp(d)  <=>  d = Log(T_true^-1 T_est)
    const Vector6d d = LogSE3(kTrueQueryCandidate * result.T_camera_points.Inverse());
    EXPECT_NEAR(error.norm(), d.norm(), 1e-9);
    sum += d.transpose() * result.information * d;
  }
  EXPECT_GT(sum / kScenes, 4.0);
  EXPECT_LT(sum / kScenes, 9.0);
}

// Second derivative of a cost around 0, by differences.
template <int N>
Eigen::Matrix<double, N, N> Curvature(const std::function<double(const Eigen::Matrix<double, N, 1>&)>& cost) {
  constexpr double kStep = 1e-4;
  const Eigen::Matrix<double, N, N> steps = kStep * Eigen::Matrix<double, N, N>::Identity();
  Eigen::Matrix<double, N, N> curvature;
  for (int a = 0; a < N; ++a) {
    for (int b = 0; b < N; ++b) {
      curvature(a, b) = (cost(steps.col(a) + steps.col(b)) - cost(steps.col(a) - steps.col(b)) -
                         cost(steps.col(b) - steps.col(a)) + cost(-steps.col(a) - steps.col(b))) /
                        (4 * kStep * kStep);
    }
  }
  return curvature;
}

// Where all residuals are 0, that of half the sum of their squares over their variances.
TEST(SolvePnp, InformationIsTheCurvatureOfTheCost) {
  const PnpData data = MakePnp(40, 0, 0, 7);
  RelativePoseOptions options;
  options.pixel_sigma = 0.7;
  std::vector<double> sigma_m;
  for (std::size_t i = 0; i < data.points.size(); ++i) sigma_m.push_back(1e-3 * static_cast<double>(i));
  const PnpResult result = SolvePnp(data.points, data.pixels, Camera(), options, sigma_m);
  ASSERT_TRUE(result.success) << result.reason;
  const Pose T_points_camera = kTrueQueryCandidate.Inverse();
  const Matrix6d expected = Curvature<6>([&](const Vector6d& tangent) {
    const Pose T_camera_points = (T_points_camera * ExpSE3(tangent)).Inverse();
    double cost = 0;
    for (std::size_t i = 0; i < data.points.size(); ++i) {
      const double depth = (kTrueQueryCandidate * data.points[i]).z();
      const double variance = 0.7 * 0.7 + std::pow(Camera().fx * sigma_m[i] / depth, 2);
      cost += 0.5 * (Camera().Project(T_camera_points * data.points[i]) - data.pixels[i]).squaredNorm() /
              variance;
    }
    return cost;
  });
  EXPECT_LT((result.information - expected).norm(), 1e-3 * expected.norm());
}

TEST(SolvePnp, RmseIsThatOfItsInliers) {
  const PnpData data = MakePnp(60, 10, 0.6, 8);
  const PnpResult result = SolvePnp(data.points, data.pixels, Camera(), {});
  double squares = 0;
  for (const int i : result.inliers) {
    const auto k = static_cast<std::size_t>(i);
    squares += (Camera().Project(result.T_camera_points * data.points[k]) - data.pixels[k]).squaredNorm();
  }
  EXPECT_NEAR(result.rmse_px, std::sqrt(squares / static_cast<double>(result.inliers.size())), 1e-9);
}

TEST(SolvePnp, SeesThroughALens) {
  PnpData data = MakePnp(40, 0, 0, 9);
  PinholeCamera lens = Camera();
  lens.fy = 540;
  lens.distortion = Distortion::kRadTan;
  lens.coefficients = {-0.2, 0.05, 1e-3, -1e-3, 0};
  for (std::size_t i = 0; i < data.points.size(); ++i)
    data.pixels[i] = lens.Project(kTrueQueryCandidate * data.points[i]);
  const PnpResult result = SolvePnp(data.points, data.pixels, lens, {});
  ASSERT_TRUE(result.success) << result.reason;
  EXPECT_EQ(result.inliers.size(), 40u);
  EXPECT_LT(LogSE3(result.T_camera_points.Inverse() * kTrueQueryCandidate).norm(), 1e-6);
}

struct SimilarityData {
  std::vector<Eigen::Vector3d> points_a, points_b;
  std::vector<Eigen::Vector2d> pixels_a, pixels_b;
};

const Similarity kTrueSimilarity(0.6, ExpSO3({0.04, 0.08, -0.02}), {0.15, 0.05, -0.1});  // S_a_b

SimilarityData MakeSimilarity(int inliers, int outliers, double sigma, std::uint32_t seed) {
  Scene scene(seed);
  SimilarityData data;
  for (int i = 0; i < inliers + outliers; ++i) {
    const Eigen::Vector3d b = scene.Point();
    const Eigen::Vector3d a = i < inliers ? kTrueSimilarity * b : scene.Point();
    const Eigen::Vector3d jitter(scene.Noise(0.005), scene.Noise(0.005), scene.Noise(0.005));
    data.points_a.push_back(a);
    data.points_b.push_back(sigma > 0 ? Eigen::Vector3d(b + jitter) : b);
    data.pixels_a.push_back(scene.Pixel(a, sigma));
    data.pixels_b.push_back(scene.Pixel(b, sigma));
  }
  return data;
}

SimilarityResult Solve(const SimilarityData& d, const RelativePoseOptions& options = {}) {
  return SolveSimilarity(d.points_a, d.pixels_a, Camera(), d.points_b, d.pixels_b, Camera(), options);
}

TEST(SolveSimilarity, FindsScaleRotationAndTranslation) {
  const SimilarityResult exact = Solve(MakeSimilarity(30, 0, 0, 1));
  ASSERT_TRUE(exact.success) << exact.reason;
  EXPECT_NEAR(exact.S_a_b.scale, 0.6, 1e-6);
  EXPECT_LT((exact.S_a_b.translation - kTrueSimilarity.translation).norm(), 1e-6);

  RelativePoseOptions options;
  options.threshold_px = 4;
  const SimilarityResult noisy = Solve(MakeSimilarity(60, 60, 0.7, 2), options);
  ASSERT_TRUE(noisy.success) << noisy.reason;
  EXPECT_GE(noisy.inliers.size(), 45u);
  EXPECT_NEAR(noisy.S_a_b.scale, 0.6, 0.01);
  EXPECT_LT((noisy.S_a_b.translation - kTrueSimilarity.translation).norm(), 0.03);
  EXPECT_GT(internal::SymmetricEigen(noisy.information).values[0], 0.0);
}

// Half the sum of the squared residuals in both images, over their variance.
TEST(SolveSimilarity, InformationIsTheCurvatureOfTheCost) {
  const SimilarityData data = MakeSimilarity(40, 0, 0, 5);
  RelativePoseOptions options;
  options.pixel_sigma = 0.7;
  const SimilarityResult result = Solve(data, options);
  ASSERT_TRUE(result.success) << result.reason;
  const Matrix7d expected = Curvature<7>([&](const Vector7d& tangent) {
    const Similarity step(std::exp(tangent[6]), ExpSO3(tangent.segment<3>(3)), tangent.head<3>());
    const Similarity S_a_b = kTrueSimilarity * step, S_b_a = S_a_b.Inverse();
    double cost = 0;
    for (std::size_t i = 0; i < data.points_a.size(); ++i) {
      cost += (Camera().Project(S_a_b * data.points_b[i]) - data.pixels_a[i]).squaredNorm();
      cost += (Camera().Project(S_b_a * data.points_a[i]) - data.pixels_b[i]).squaredNorm();
    }
    return 0.5 * cost / (0.7 * 0.7);
  });
  EXPECT_LT((result.information - expected).norm(), 1e-3 * expected.norm());
}

TEST(SolveSimilarity, RmseIsThatOfItsInliersInBothImages) {
  const SimilarityData data = MakeSimilarity(60, 10, 0.5, 6);
  RelativePoseOptions options;
  options.threshold_px = 4;
  const SimilarityResult result = Solve(data, options);
  double squares = 0;
  for (const int i : result.inliers) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Vector2d in_a = Camera().Project(result.S_a_b * data.points_b[k]) - data.pixels_a[k];
    const Eigen::Vector2d in_b =
        Camera().Project(result.S_a_b.Inverse() * data.points_a[k]) - data.pixels_b[k];
    EXPECT_LT(std::max(in_a.norm(), in_b.norm()), 4);
    squares += 0.5 * (in_a.squaredNorm() + in_b.squaredNorm());
  }
  EXPECT_NEAR(result.rmse_px, std::sqrt(squares / static_cast<double>(result.inliers.size())), 1e-9);
}

TEST(SolveSimilarity, SaysWhyItFails) {
  EXPECT_NE(Solve(MakeSimilarity(2, 0, 0, 3)).reason.find("only 2 matches"), std::string::npos);
  EXPECT_FALSE(Solve(MakeSimilarity(0, 50, 0, 4)).success);
}

TEST(RelativePoseOptions, ValidateNamesTheField) {
  RelativePoseOptions options;
  EXPECT_EQ(options.Validate(), "");
  options.threshold_px = 0;
  EXPECT_NE(options.Validate().find("threshold_px"), std::string::npos);
  options = {};
  options.min_inliers = 3;
  EXPECT_NE(options.Validate().find("min_inliers"), std::string::npos);
  options = {};
  options.confidence = 1;
  EXPECT_NE(options.Validate().find("confidence"), std::string::npos);
}

}  // namespace
}  // namespace tutti
