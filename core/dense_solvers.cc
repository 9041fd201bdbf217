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

// Where Eigen sums up a triangle's rows in another order if it knows their number, it is told.
template <int N>
Eigen::Matrix<double, N, 1> SolveLdlt(const Eigen::Matrix<double, N, N>& a,
                                      const Eigen::Matrix<double, N, 1>& b) {
  const Eigen::LDLT<SmallMatrix> factor(a);
  if constexpr (N < 3 || N > 8) {
    return factor.solve(SmallVector(b));
  } else {
    const Eigen::Matrix<double, N, N> ldlt = factor.matrixLDLT();
    Eigen::Matrix<double, N, 1> x = factor.transpositionsP() * b;
    ldlt.template triangularView<Eigen::UnitLower>().solveInPlace(x);
    for (int i = 0; i < N; ++i)  // as Eigen does: zero where the pivot is
      x(i) = std::abs(ldlt(i, i)) > std::numeric_limits<double>::min() ? x(i) / ldlt(i, i) : 0;
    ldlt.transpose().template triangularView<Eigen::UnitUpper>().solveInPlace(x);
    return factor.transpositionsP().transpose() * x;
  }
}

#define TUTTI_SOLVE_LDLT(N)                                                             \
  template Eigen::Matrix<double, N, 1> SolveLdlt<N>(const Eigen::Matrix<double, N, N>&, \
                                                    const Eigen::Matrix<double, N, 1>&);
TUTTI_SOLVE_LDLT(1)
TUTTI_SOLVE_LDLT(2)
TUTTI_SOLVE_LDLT(3)
TUTTI_SOLVE_LDLT(6)
TUTTI_SOLVE_LDLT(7)
TUTTI_SOLVE_LDLT(12)
TUTTI_SOLVE_LDLT(13)
#undef TUTTI_SOLVE_LDLT

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
