// Decompositions of small dense matrices. Not installed.
//
// They are Eigen's, compiled here once: the templates behind each of them cost a compiler seconds in every
// file that they are called from. The bits are those of Eigen's matrices of fixed size, but for eigenvalues
// of 3 rows and inverses of fewer than 5, where Eigen has formulas for the size.
#pragma once

#include <Eigen/Core>
#include <optional>

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

constexpr int kMostRows = 13;
/// A matrix of at most kMostRows rows and columns takes no memory from the heap.
using SmallMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, kMostRows, kMostRows>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMostRows, 1>;
using SmallMatrixRef = Eigen::Ref<const SmallMatrix, 0, Eigen::OuterStride<>>;

/// Column k of `vectors` belongs to value k and has length 1.
struct Eigenpairs {
  SmallVector values;
  SmallMatrix vectors;
};

/// Eigenpairs of a symmetric matrix, values ascending; its lower triangle alone is read.
Eigenpairs SymmetricEigen(const SmallMatrixRef& a);

/// Eigenpairs of any square matrix: those whose imaginary part is at most this, in Eigen's order. None where
/// the iteration does not converge.
Eigenpairs RealEigen(const SmallMatrixRef& a, double most_imaginary);

/// U with U^T U = a, upper triangular. Of a matrix that is not positive definite: what was found until that
/// showed.
struct CholeskyFactor {
  SmallMatrix upper;
  bool positive_definite = false;
};
CholeskyFactor UpperCholesky(const SmallMatrixRef& a);

/// By LU with partial pivoting.
SmallMatrix Inverse(const SmallMatrixRef& a);
/// x of a x = b for each column of `b`, likewise.
SmallMatrix SolveLu(const SmallMatrixRef& a, const SmallMatrixRef& b);

/// x of a x = b by LDL^T with pivoting, `a` positive or negative semidefinite with `n` rows, at most
/// kMostRows.
void SolveLdlt(int n, const double* a, const double* b, double* x);
template <int N>
Eigen::Matrix<double, N, 1> SolveLdlt(const Eigen::Matrix<double, N, N>& a,
                                      const Eigen::Matrix<double, N, 1>& b) {
  static_assert(N <= kMostRows && N != 4 && N != 5 && N != 8, "Eigen's bits need a case of their own");
  Eigen::Matrix<double, N, 1> x;
  SolveLdlt(N, a.data(), b.data(), x.data());
  return x;
}
/// SolveLdlt for each column of `b`.
SmallMatrix SolveLdlt(const SmallMatrixRef& a, const SmallMatrixRef& b);

/// The covariance that belongs to an information matrix; none if it is not positive definite or nearly
/// singular (reciprocal condition number not above 1e-12).
std::optional<SmallMatrix> InverseInformation(const SmallMatrixRef& information);

/// a = u diag(values) v^T, values descending.
struct Svd3 {
  Eigen::Matrix3d u, v;
  Eigen::Vector3d values;
};
Svd3 SingularValues(const Eigen::Matrix3d& a);

}  // namespace tutti::internal
#pragma GCC visibility pop
