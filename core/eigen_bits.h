// Steps of decompositions with the bits of Eigen's templates, which cost a compiler seconds each. Not
// installed.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Householder>
#include <cmath>
#include <limits>
#include <utility>

namespace tutti::internal {

/// q = H_0 H_1 ... q, the first reflection from row `shift` on, one for each coefficient: their vectors stand
/// below the diagonal of `packed`, further down by `shift`. The bits are those of Eigen's
/// HouseholderSequence, whose template also makes the compiler work out the way for 48 reflections and more.
template <class Packed, class Coefficients, class Matrix>
void Reflect(const Packed& packed, const Coefficients& coefficients, Eigen::Index shift, Matrix* q) {
  Eigen::Matrix<double, 1, Matrix::ColsAtCompileTime, Eigen::RowMajor, 1, Matrix::MaxColsAtCompileTime>
      workspace(q->cols());
  for (Eigen::Index k = coefficients.size(); k-- > 0;) {
    const Eigen::Index rows = q->rows() - shift - k;
    q->bottomRows(rows).applyHouseholderOnTheLeft(packed.col(k).tail(rows - 1), coefficients(k),
                                                  workspace.data());
  }
}

/// x of a x = b, `a` factored by Eigen's LDLT. The bits are those of LDLT::solve() of a matrix of fixed size.
/// Eigen writes that out for each size and kind of right side, which costs a compiler a second per size; here
/// the sizes share one set of sums.
namespace small_ldlt {

// In the order in which Eigen sums up `Length` products; those of `a` are `stride` apart.
template <int Length, int Stride, class Scalar>
Scalar Dot(const Scalar* a, Eigen::Index stride, const Scalar* b) {
  using Vector = Eigen::Matrix<Scalar, Length, 1>;
  const Eigen::Map<const Vector, Eigen::Unaligned, Eigen::InnerStride<Stride>> left(
      a, Eigen::InnerStride<Stride>(stride));
  return left.cwiseProduct(Eigen::Map<const Vector>(b)).sum();
}

// y = L^-1 y from row `Row` on; L is `n` columns of `n` numbers, its diagonal 1 and not stored.
template <int Most, int Row, class Scalar>
void SolveLower(const Scalar* factor, Eigen::Index n, Scalar* y) {
  if constexpr (Row < Most) {
    if (Row >= n) return;
    y[Row] -= Dot<Row, Eigen::Dynamic>(factor + Row, n, y);
    SolveLower<Most, Row + 1>(factor, n, y);
  }
}

// y = L^-T y up from the row that `Below` rows are below.
template <int Most, int Below, class Scalar>
void SolveUpper(const Scalar* factor, Eigen::Index n, Scalar* y) {
  if constexpr (Below < Most) {
    if (Below >= n) return;
    const Eigen::Index row = n - 1 - Below;
    y[row] -= Dot<Below, 1>(factor + row * n + row + 1, 1, y + row + 1);
    SolveUpper<Most, Below + 1>(factor, n, y);
  }
}

// x of a x = b, in place of b; at most `Most` rows. Where the pivot is 0 x is, too, as with Eigen.
template <int Most, class Matrix>
void SolveInPlace(const Eigen::LDLT<Matrix>& a, typename Matrix::Scalar* x) {
  using Scalar = typename Matrix::Scalar;
  const Scalar* factor = a.matrixLDLT().data();
  const auto& swapped = a.transpositionsP().indices();
  const Eigen::Index n = a.rows();
  for (Eigen::Index i = 0; i < n; ++i) std::swap(x[i], x[swapped(i)]);
  SolveLower<Most, 1>(factor, n, x);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Scalar pivot = factor[i * n + i];
    x[i] = std::abs(pivot) > std::numeric_limits<Scalar>::min() ? x[i] / pivot : 0;
  }
  SolveUpper<Most, 1>(factor, n, x);
  for (Eigen::Index i = n; i-- > 0;) std::swap(x[i], x[swapped(i)]);
}

}  // namespace small_ldlt
}  // namespace tutti::internal
