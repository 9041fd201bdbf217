#include "core/dense_solvers.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>

#include "core/eigen_bits.h"

namespace tutti::internal {

CholeskyFactor UpperCholesky(const SmallMatrixRef& a) {
  const Eigen::LLT<SmallMatrix> factor(a);
  return {factor.matrixU(), factor.info() == Eigen::Success};
}

SmallMatrix Inverse(const SmallMatrixRef& a) { return Eigen::PartialPivLU<SmallMatrix>(a).inverse(); }

SmallMatrix SolveLu(const SmallMatrixRef& a, const SmallMatrixRef& b) {
  return Eigen::PartialPivLU<SmallMatrix>(a).solve(SmallMatrix(b));
}

void SolveLdlt(int n, const double* a, const double* b, double* x) {
  const Eigen::LDLT<SmallMatrix> factor(Eigen::Map<const Eigen::MatrixXd>(a, n, n));
  // For these sizes the order of Eigen's sums depends on whether it knows them.
  if (n == 3 || n == 6 || n == 7) {
    std::copy_n(b, n, x);
    small_ldlt::SolveInPlace<7>(factor, x);
    return;
  }
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
