// Systems of equations A x = b of one pattern, one after the other. Private to the back end.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
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

  /// As BlockCholesky::Analyse.
  void Analyse(int size, std::vector<std::pair<int, int>> pairs) {
    pairs_ = std::move(pairs);
    cholesky_.Analyse(size, pairs_);
    has_factor_ = false;
    most_iterations_ = static_cast<int>(std::min(15.0, 0.5 * cholesky_.SolvesPerFactorisation()));
  }

  /// Solves in place; the blocks are as those of BlockCholesky::Factorise. False if the matrix is not
  /// positive definite, as far as that shows, or the solution not finite.
  bool Solve(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal, Eigen::VectorXd& b) {
    if (has_factor_ && most_iterations_ > 1 && ConjugateGradients(diagonal, off_diagonal, b)) return true;
    has_factor_ = cholesky_.Factorise(diagonal, off_diagonal);
    if (!has_factor_) return false;
    cholesky_.Solve(b);
    return b.allFinite();
  }

 private:
  static constexpr double kTolerance = 1e-2;  // of the error, in the preconditioner's norm

  /// False, and `b` as it was, if they do not get there.
  bool ConjugateGradients(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal,
                          Eigen::VectorXd& b) {
    Eigen::VectorXd x = Eigen::VectorXd::Zero(b.size()), r = b, z = b;
    cholesky_.Solve(z);
    Eigen::VectorXd p = z, product;
    double rz = r.dot(z);
    const double enough = kTolerance * kTolerance * rz;
    for (int k = 0; k < most_iterations_ && rz > enough; ++k) {
      Multiply(diagonal, off_diagonal, p, product);
      const double curvature = p.dot(product);
      if (!(curvature > 0)) return false;
      x += rz / curvature * p;
      r -= rz / curvature * product;
      z = r;
      cholesky_.Solve(z);
      const double last = rz;
      rz = r.dot(z);
      p = z + rz / last * p;
    }
    if (!(rz <= enough) || !x.allFinite()) return false;
    b = x;
    return true;
  }

  void Multiply(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal,
                const Eigen::VectorXd& x, Eigen::VectorXd& out) const {
    out.resize(x.size());
    for (std::size_t k = 0; k < diagonal.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(N * k);
      out.segment<N>(at).noalias() = diagonal[k] * x.segment<N>(at);
    }
    for (std::size_t p = 0; p < pairs_.size(); ++p) {
      const Eigen::Index row = N * pairs_[p].first, column = N * pairs_[p].second;
      out.segment<N>(row).noalias() += off_diagonal[p] * x.segment<N>(column);
      out.segment<N>(column).noalias() += off_diagonal[p].transpose() * x.segment<N>(row);
    }
  }

  std::vector<std::pair<int, int>> pairs_;
  BlockCholesky<N> cholesky_;
  bool has_factor_ = false;
  int most_iterations_ = 0;  // of conjugate gradients: half of what a factorisation takes
};

}  // namespace tutti::internal
