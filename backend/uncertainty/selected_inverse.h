// The entries of the inverse of a sparse matrix where its Cholesky factor is not zero. Private to the back
// end.
#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <vector>

namespace tutti::internal {

/// Z = H^-1 of a symmetric positive definite H, but only where the factor L of H = P^T L L^T P has an entry;
/// that takes in every entry that H has itself. From the last column to the first (Takahashi, Fagan and Chen,
/// 1973):
///   Z_ij = (delta_ij / L_jj - sum_{k > j} L_kj Z_ik) / L_jj,  i >= j,
/// where all Z_ik that are asked for lie in the pattern of L. Time: that of a simplicial factorisation, about
/// twice.
class SelectedInverse {
 public:
  /// `H`: lower triangle. Ok() says whether H could be factored.
  explicit SelectedInverse(const Eigen::SparseMatrix<double>& H);

  bool Ok() const { return ok_; }
  /// Z_rc. (r, c) or (c, r) must be an entry of H.
  double At(int r, int c) const;

 private:
  /// By row: L's column j below the diagonal, the sums of the formula, and j where the other two are of that
  /// column.
  struct Scratch {
    std::vector<double> column, sum;
    std::vector<int> owner;
  };

  void Invert();
  void InvertColumn(int j, Scratch& scratch);

  bool ok_ = false;
  Eigen::SparseMatrix<double> L_;  ///< the factor, permuted
  Eigen::VectorXi place_;          ///< of each row of H in L
  std::vector<double> Z_;          ///< parallel to L's values
};

}  // namespace tutti::internal
