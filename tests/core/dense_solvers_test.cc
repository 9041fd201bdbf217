// What is compiled once for any size answers as Eigen's own for matrices of fixed size, bit by bit. Sizes
// that are in use, and the largest: each costs a compiler four to eight seconds here.
#include "core/dense_solvers.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

#include "core/eigen_bits.h"
#include "tutti/core/pose.h"

namespace tutti::internal {
namespace {

template <int N>
Eigen::Matrix<double, N, N> Random(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  return Eigen::Matrix<double, N, N>::NullaryExpr([&] { return normal(random); });
}

template <int N>
Eigen::Matrix<double, N, N> RandomInformation(std::mt19937_64& random) {
  const Eigen::Matrix<double, N, N> a = Random<N>(random);
  return a * a.transpose();
}

// Without what GTest needs to print matrices of each size.
template <typename Matrix>
bool Same(const Matrix& a, const Matrix& b) {
  return std::equal(a.data(), a.data() + a.size(), b.data(), b.data() + b.size());
}

template <int N>
void ExpectEigensLdlt() {
  std::mt19937_64 random(N);
  for (int k = 0; k < 200; ++k) {
    Eigen::Matrix<double, N, N> a = RandomInformation<N>(random);
    if (k % 3 == 0) {  // one unknown is not determined
      a.row(1).setZero();
      a.col(1).setZero();
    }
    const Eigen::Matrix<double, N, 1> b = Random<N>(random).col(0);
    const Eigen::Matrix<double, N, 1> expected = a.ldlt().solve(b);
    ASSERT_TRUE(Same(SolveLdlt<N>(a, b), expected)) << N << " unknowns, case " << k;
  }
}

TEST(DenseSolvers, SolveLdltHasEigensBits) {
  ExpectEigensLdlt<2>();
  ExpectEigensLdlt<3>();
  ExpectEigensLdlt<6>();
  ExpectEigensLdlt<7>();
  ExpectEigensLdlt<13>();
}

TEST(DenseSolvers, SolveLdltOfColumnsHasEigensBits) {
  std::mt19937_64 random(1);
  const Matrix7d a = RandomInformation<7>(random), b = Random<7>(random);
  EXPECT_TRUE(Same<Matrix7d>(SolveLdlt(a, b), a.ldlt().solve(b)));
}

template <int N>
void ExpectEigensSingleLdlt() {
  std::mt19937_64 random(N);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Matrix<float, N, N> a = RandomInformation<N>(random).template cast<float>();
    const Eigen::Matrix<float, N, 1> b = Random<N>(random).col(0).template cast<float>();
    const Eigen::LDLT<Eigen::Matrix<float, N, N>> factor(a);
    Eigen::Matrix<float, N, 1> x = b;
    small_ldlt::SolveInPlace<N>(factor, x.data());
    const Eigen::Matrix<float, N, 1> expected = factor.solve(b);
    ASSERT_TRUE(Same(x, expected)) << N << " unknowns, case " << k;
  }
}

TEST(DenseSolvers, SmallLdltOfSinglePrecisionHasEigensBits) {
  ExpectEigensSingleLdlt<4>();
  ExpectEigensSingleLdlt<5>();
}

TEST(DenseSolvers, SolveLuHasEigensBits) {
  std::mt19937_64 random(3);
  for (int k = 0; k < 200; ++k) {
    using Matrix10d = Eigen::Matrix<double, 10, 10>;
    const Matrix10d a = Random<10>(random), b = Random<10>(random);
    ASSERT_TRUE(Same<Matrix10d>(SolveLu(a, b), a.partialPivLu().solve(b)));
  }
}

template <int N>
void ExpectEigensSpectrum() {
  std::mt19937_64 random(N);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Matrix<double, N, N> a = RandomInformation<N>(random);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, N, N>> expected(a);
    const Eigenpairs found = SymmetricEigen(a);
    ASSERT_TRUE((Same<Eigen::Matrix<double, N, 1>>(found.values, expected.eigenvalues())))
        << N << " rows, case " << k;
    ASSERT_TRUE((Same<Eigen::Matrix<double, N, N>>(found.vectors, expected.eigenvectors())));
  }
}

TEST(DenseSolvers, SymmetricEigenHasEigensBits) {
  ExpectEigensSpectrum<2>();
  ExpectEigensSpectrum<4>();
  ExpectEigensSpectrum<6>();
  ExpectEigensSpectrum<7>();
  ExpectEigensSpectrum<13>();
}

TEST(DenseSolvers, SymmetricEigenOfASingleNumberAndOfZeros) {
  const Eigenpairs single = SymmetricEigen(SmallMatrix::Constant(1, 1, -3));
  EXPECT_EQ(single.values(0), -3);
  EXPECT_EQ(single.vectors(0, 0), 1);
  const Eigenpairs zeros = SymmetricEigen(SmallMatrix::Zero(4, 4));
  EXPECT_EQ(Eigen::Vector4d(zeros.values), Eigen::Vector4d::Zero());
  EXPECT_EQ(Eigen::Matrix4d(zeros.vectors), Eigen::Matrix4d::Identity());
}

TEST(DenseSolvers, InverseAndCholeskyHaveEigensBits) {
  std::mt19937_64 random(2);
  for (int k = 0; k < 200; ++k) {
    const Matrix6d a = RandomInformation<6>(random);
    ASSERT_TRUE(Same<Matrix6d>(Inverse(a), a.inverse()));
    ASSERT_TRUE(Same<Matrix6d>(UpperCholesky(a).upper, a.llt().matrixU()));
    ASSERT_TRUE(UpperCholesky(a).positive_definite);
  }
  Matrix6d indefinite = Matrix6d::Identity();
  indefinite(3, 3) = -1;
  EXPECT_FALSE(UpperCholesky(indefinite).positive_definite);
}

TEST(DenseSolvers, OnlyAnInformationThatTellsAllHasAnInverse) {
  std::mt19937_64 random(3);
  const Matrix6d a = RandomInformation<6>(random);
  const auto covariance = InverseInformation(a);
  ASSERT_TRUE(covariance);
  EXPECT_LT((Matrix6d(*covariance) * a - Matrix6d::Identity()).norm(), 1e-6);
  Matrix6d open = a;
  open.row(2).setZero();
  open.col(2).setZero();
  EXPECT_FALSE(InverseInformation(open));
  EXPECT_FALSE(InverseInformation(-a));
}

// A rotation about z by 90 degrees, with a third axis: the roots are 2 and +-i.
TEST(DenseSolvers, RealEigenLeavesOutComplexRoots) {
  Eigen::Matrix3d a;
  a << 0, -1, 0, 1, 0, 0, 0, 0, 2;
  const Eigenpairs found = RealEigen(a, 1e-10);
  ASSERT_EQ(found.values.size(), 1);
  EXPECT_NEAR(found.values(0), 2, 1e-12);
  EXPECT_NEAR(std::abs(found.vectors(2, 0)), 1, 1e-12);
  EXPECT_EQ(RealEigen(a, 2).values.size(), 3);
}

TEST(DenseSolvers, SingularValuesMakeTheMatrixAgain) {
  std::mt19937_64 random(4);
  const Eigen::Matrix3d a = Random<3>(random);
  const Svd3 svd = SingularValues(a);
  EXPECT_LT((svd.u * svd.values.asDiagonal() * svd.v.transpose() - a).norm(), 1e-12);
  EXPECT_LT((svd.u * svd.u.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  EXPECT_GE(svd.values(0), svd.values(1));
  EXPECT_GE(svd.values(1), svd.values(2));
}

}  // namespace
}  // namespace tutti::internal
