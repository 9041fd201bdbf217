// Products with the orthogonal matrix of a decomposition that Eigen made. Not installed.
#pragma once

#include <Eigen/Core>
#include <Eigen/Householder>

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

}  // namespace tutti::internal
