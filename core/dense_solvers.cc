#include "core/dense_solvers.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

namespace tutti::internal {

CholeskyFactor UpperCholesky(const SmallMatrixRef& a) {
  const Eigen::LLT<SmallMatrix> factor(a);
  return {factor.matrixU(), factor.info() == Eigen::Success};
}

SmallMatrix Inverse(const SmallMatrixRef& a) { return Eigen::PartialPivLU<SmallMatrix>(a).inverse(); }

namespace {

// Where Eigen sums up a triangle's rows in another order if it knows their number, it is told.
template <int N>
void SolveFixed(const double* a, const double* b, double* x) {
  const Eigen::Map<const Eigen::Matrix<double, N, N>> matrix(a);
  const Eigen::Map<const Eigen::Matrix<double, N, 1>> right(b);
  Eigen::Map<Eigen::Matrix<double, N, 1>> out(x);
  const Eigen::LDLT<SmallMatrix> factor(matrix);
  const Eigen::Matrix<double, N, N> ldlt = factor.matrixLDLT();
  Eigen::Matrix<double, N, 1> y = factor.transpositionsP() * right;
  ldlt.template triangularView<Eigen::UnitLower>().solveInPlace(y);
  for (int i = 0; i < N; ++i)  // as Eigen does: zero where the pivot is
    y(i) = std::abs(ldlt(i, i)) > std::numeric_limits<double>::min() ? y(i) / ldlt(i, i) : 0;
  ldlt.transpose().template triangularView<Eigen::UnitUpper>().solveInPlace(y);
  out = factor.transpositionsP().transpose() * y;
}

}  // namespace

void SolveLdlt(int n, const double* a, const double* b, double* x) {
  if (n == 3) return SolveFixed<3>(a, b, x);
  if (n == 6) return SolveFixed<6>(a, b, x);
  if (n == 7) return SolveFixed<7>(a, b, x);
  const Eigen::LDLT<SmallMatrix> factor(Eigen::Map<const Eigen::MatrixXd>(a, n, n));
  Eigen::Map<Eigen::VectorXd>(x, n) = factor.solve(SmallVector(Eigen::Map<const Eigen::VectorXd>(b, n)));
}

SmallMatrix SolveLdlt(const SmallMatrixRef& a, const SmallMatrixRef& b) {
  return Eigen::LDLT<SmallMatrix>(a).solve(SmallMatrix(b));
}

std::optional<SmallMatrix> InverseInformation(const SmallMatrixRef& information) {
  const Eigen::LDLT<SmallMatrix> factor(information);
  const bool positive = factor.info() == Eigen::Success && factor.vectorD().minCoeff() > 0;
  if (!positive || !(factor.rcond() > 1e-12)) return std::nullopt;  // rcond() does not see pivots of 0
  const SmallMatrix identity = SmallMatrix::Identity(information.rows(), information.rows());
  return SmallMatrix(factor.solve(identity));
}

Svd3 SingularValues(const Eigen::Matrix3d& a) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.matrixU(), svd.matrixV(), svd.singularValues()};
}

}  // namespace tutti::internal
