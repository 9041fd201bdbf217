// The essential matrix of two views of one calibrated camera.
#include <Eigen/Geometry>
#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/dense_solvers.h"
#include "core/eigen_bits.h"
#include "frontend/geometry/two_view.h"

namespace tutti::internal {
namespace {

constexpr int kSample = 5;  // pairs

// Polynomials in x, y and z by their coefficients.
using Linear = Eigen::Vector4d;                  // x y z 1
using Quadratic = Eigen::Matrix<double, 10, 1>;  // xx xy xz x yy yz y zz z 1
// xxx xxy xxz xyy xyz xzz yyy yyz yzz zzz, xx xy xz yy yz zz, x y z 1
using Cubic = Eigen::Matrix<double, 20, 1>;

// Where a product of two coefficients belongs.
constexpr std::array<std::array<int, 4>, 4> kQuadratic = {
    {{0, 1, 2, 3}, {1, 4, 5, 6}, {2, 5, 7, 8}, {3, 6, 8, 9}}};
constexpr int kCubic[10][4] = {{0, 1, 2, 10},    {1, 3, 4, 11},   {2, 4, 5, 12},    {10, 11, 12, 16},
                               {3, 6, 7, 13},    {4, 7, 8, 14},   {11, 13, 14, 17}, {5, 8, 9, 15},
                               {12, 14, 15, 18}, {16, 17, 18, 19}};

Quadratic Product(const Linear& a, const Linear& b) {
  Quadratic product = Quadratic::Zero();
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) product(kQuadratic[i][j]) += a(i) * b(j);
  }
  return product;
}

Cubic Product(const Quadratic& a, const Linear& b) {
  Cubic product = Cubic::Zero();
  for (int i = 0; i < 10; ++i) {
    for (int j = 0; j < 4; ++j) product(kCubic[i][j]) += a(i) * b(j);
  }
  return product;
}

// What makes x E1 + y E2 + z E3 + E4 an essential matrix: det E = 0, and 2 E E' E = trace(E E') E.
Eigen::Matrix<double, 10, 20> Constraints(const std::array<std::array<Linear, 3>, 3>& e) {
  Eigen::Matrix<double, 10, 20> constraints;
  const auto minor = [&e](int c, int d) {
    return Quadratic(Product(e[1][c], e[2][d]) - Product(e[1][d], e[2][c]));
  };
  constraints.row(0) =
      Product(minor(1, 2), e[0][0]) + Product(minor(2, 0), e[0][1]) + Product(minor(0, 1), e[0][2]);
  std::array<std::array<Quadratic, 3>, 3> square;  // E E'
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c)
      square[r][c] = Product(e[r][0], e[c][0]) + Product(e[r][1], e[c][1]) + Product(e[r][2], e[c][2]);
  }
  const Quadratic half_trace = 0.5 * (square[0][0] + square[1][1] + square[2][2]);
  for (int i = 0; i < 3; ++i) square[i][i] -= half_trace;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c)
      constraints.row(1 + 3 * r + c) =
          Product(square[r][0], e[0][c]) + Product(square[r][1], e[1][c]) + Product(square[r][2], e[2][c]);
  }
  return constraints;
}

// Squared: to the first order, how far both rays are from ones that meet.
double SampsonDistance2(const Eigen::Matrix3d& e, const Eigen::Vector2d& first,
                        const Eigen::Vector2d& second) {
  const Eigen::Vector3d line = e * first.homogeneous(), back = e.transpose() * second.homogeneous();
  const double error = second.homogeneous().dot(line);
  return error * error / (line.head<2>().squaredNorm() + back.head<2>().squaredNorm());
}

// How many samples find one without outliers with this confidence.
int SamplesNeeded(double confidence, double inlier_share, int most) {
  const double all_missed = std::log(std::max(1 - confidence, std::numeric_limits<double>::min()));
  const double missed = std::log1p(-std::pow(inlier_share, kSample));
  return missed * most >= all_missed ? most : static_cast<int>(std::ceil(all_missed / missed));
}

}  // namespace

std::vector<Eigen::Matrix3d> FivePointEssential(const Eigen::Matrix<double, kSample, 2>& first,
                                                const Eigen::Matrix<double, kSample, 2>& second) {
  Eigen::Matrix<double, 9, kSample> equations;  // a column per pair, of E's elements by rows
  for (int i = 0; i < kSample; ++i) {
    const Eigen::Vector3d a(first(i, 0), first(i, 1), 1), b(second(i, 0), second(i, 1), 1);
    for (int r = 0; r < 3; ++r) equations.block<3, 1>(3 * r, i) = b(r) * a;
  }
  // Every solution is a sum of these four, scaled so that the last has weight 1.
  const Eigen::ColPivHouseholderQR<Eigen::Matrix<double, 9, kSample>> qr(equations);
  if (qr.rank() < kSample) return {};
  Eigen::Matrix<double, 9, 4> basis = Eigen::Matrix<double, 9, 9>::Identity().rightCols<4>();
  Reflect(qr.matrixQR(), qr.hCoeffs(), 0, &basis);
  std::array<std::array<Linear, 3>, 3> e;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) e[r][c] = basis.row(3 * r + c).transpose();
  }
  // Each cubic monomial as a sum of the ten others. Then, by these, x times each of the ten.
  const Eigen::Matrix<double, 10, 20> constraints = Constraints(e);
  const Eigen::Matrix<double, 10, 10> reduced =
      SolveLu(constraints.leftCols<10>(), constraints.rightCols<10>());
  if (!reduced.allFinite()) return {};
  Eigen::Matrix<double, 10, 10> times_x = Eigen::Matrix<double, 10, 10>::Zero();
  times_x.topRows<6>() = -reduced.topRows<6>();
  times_x(6, 0) = times_x(7, 1) = times_x(8, 2) = times_x(9, 6) = 1;
  constexpr double kReal = 1e-10;  // a double root may split into two that are nearly real
  const Eigenpairs found = RealEigen(times_x, kReal);
  std::vector<Eigen::Matrix3d> solutions;
  for (Eigen::Index i = 0; i < found.values.size(); ++i) {
    const Eigen::Vector4d weights = found.vectors.col(i).tail<4>();  // of x, y, z and 1
    const Eigen::Matrix<double, 9, 1> solution = (basis * weights).normalized();
    if (!solution.allFinite()) continue;
    solutions.emplace_back(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(solution.data()));
  }
  return solutions;
}

std::optional<EssentialMatrix> FitEssential(const std::vector<Eigen::Vector2d>& first,
                                            const std::vector<Eigen::Vector2d>& second, double threshold,
                                            double confidence) {
  constexpr int kMostSamples = 1000;
  const int count = static_cast<int>(first.size());
  if (count < kSample) return std::nullopt;
  cv::RNG random(std::numeric_limits<std::uint64_t>::max());
  EssentialMatrix best;
  int needed = kMostSamples;
  for (int sample = 0; sample < needed; ++sample) {
    std::array<int, kSample> chosen{};
    Eigen::Matrix<double, kSample, 2> a, b;
    for (int i = 0; i < kSample; ++i) {
      do chosen[i] = random.uniform(0, count);
      while (std::find(chosen.begin(), chosen.begin() + i, chosen[i]) != chosen.begin() + i);
      a.row(i) = first[static_cast<std::size_t>(chosen[i])];
      b.row(i) = second[static_cast<std::size_t>(chosen[i])];
    }
    for (const Eigen::Matrix3d& e : FivePointEssential(a, b)) {
      int inliers = 0;
      for (std::size_t i = 0; i < first.size(); ++i)
        inliers += SampsonDistance2(e, first[i], second[i]) <= threshold * threshold ? 1 : 0;
      if (inliers <= std::max(best.inliers, kSample - 1)) continue;
      best = {e, inliers};
      needed = SamplesNeeded(confidence, static_cast<double>(inliers) / count, needed);
    }
  }
  if (best.inliers == 0) return std::nullopt;
  return best;
}

}  // namespace tutti::internal
