// Systems of equations A x = b of one pattern, one after the other. Private to the back end.
#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "backend/solver/block_cholesky.h"

namespace tutti::internal {

/// From one iteration of a descent to the next the matrix changes little, and a factorisation takes ten times
/// as long as a solution with it and more. So the last factor preconditions conjugate gradients (Hestenes and
/// Stiefel 1952; Nash, "A survey of truncated-Newton methods", 2000), and a new one is made where they would
/// take long. They stop early: what they leave of the error, the next iteration removes. The step that they
/// have found by then lowers a quadratic model by as much as its own formula says.
template <int N>
class BlockSystem {
 public:
  using Block = Eigen::Matrix<double, N, N>;

  /// Analyses the pattern (BlockCholesky::Analyse).
  void Analyse(int size, std::vector<std::pair<int, int>> pairs);

  /// Solves in place; the blocks are as those of BlockCholesky::Factorise. False if the matrix is not
  /// positive definite, as far as that shows, or the solution not finite.
  bool Solve(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal, Eigen::VectorXd& b);

 private:
  static constexpr double kTolerance = 1e-2;  // of the error, in the preconditioner's norm

  /// False, and `b` as it was, if they do not get there.
  bool ConjugateGradients(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal,
                          Eigen::VectorXd& b);

  void Multiply(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal,
                const Eigen::VectorXd& x, Eigen::VectorXd& out) const;

  std::vector<std::pair<int, int>> pairs_;
  BlockCholesky<N> cholesky_;
  bool has_factor_ = false;
  int most_iterations_ = 0;  // of conjugate gradients: half of what a factorisation takes
};

extern template class BlockSystem<3>;
extern template class BlockSystem<6>;
extern template class BlockSystem<7>;

}  // namespace tutti::internal
