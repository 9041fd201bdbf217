// The normal equations of the camera poses and the lens, after the landmarks were eliminated.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <memory>
#include <utility>
#include <vector>

#include "tutti/core/pose.h"

namespace tutti {

/// Symmetric, 6 unknowns a camera and 2 of the lens; only blocks (a, b) with b <= a are kept. A few cameras:
/// dense. Many: sparse, since far cameras share no landmarks, with the lens as a border.
class ReducedSystem {
 public:
  /// `pairs`: cameras (a, b), b < a, that share landmarks; any order, repeated or not.
  ReducedSystem(int cameras, std::vector<std::pair<int, int>> pairs);

  static bool IsSparse(int cameras) { return cameras > kMostDense; }

  void SetZero();
  void SetDiagonal(int camera, const Matrix6d& block);
  void SetLens(const Eigen::Matrix2d& block) { lens_ = block; }
  void AddLens(const Eigen::Matrix2d& block) { lens_ += block; }
  void AddLens(int camera, const Eigen::Matrix<double, 2, 6>& block);
  /// block (a, b) -= `product`; b <= a.
  template <class Product>
  void Subtract(int a, int b, const Product& product) {
    if (dense_.size() != 0)
      dense_.block<6, 6>(6 * a, 6 * b).noalias() -= product;
    else
      blocks_[Index(a, b)].noalias() -= product;
  }

  /// Right side and solution have 6 * cameras + 2 entries. False if the system is not positive definite.
  /// `lens_information`: what is known of the lens alone.
  bool Solve(const Eigen::VectorXd& right, Eigen::VectorXd* solution, Eigen::Matrix2d* lens_information);

 private:
  static constexpr int kMostDense = 60;
  using Sparse = Eigen::SparseMatrix<double>;

  std::size_t Index(int a, int b) const;
  bool SolveDense(const Eigen::VectorXd& right, Eigen::VectorXd* solution, Eigen::Matrix2d* lens_information);
  bool SolveSparse(const Eigen::VectorXd& right, Eigen::VectorXd* solution,
                   Eigen::Matrix2d* lens_information);
  void FillSparse();

  int cameras_;
  Eigen::Matrix2d lens_ = Eigen::Matrix2d::Zero();
  Eigen::MatrixXd dense_;
  // Sparse: the blocks of row 0, of row 1, ..., each ascending by column, the diagonal last.
  std::vector<std::size_t> first_block_;
  std::vector<int> column_;
  std::vector<Matrix6d> blocks_;
  Eigen::MatrixXd border_;  // poses by lens
  Sparse matrix_;           // the upper triangle of the transpose: column-major, so a block row is 6 columns
  std::unique_ptr<Eigen::SimplicialLLT<Sparse, Eigen::Upper>> factor_;
};

}  // namespace tutti
