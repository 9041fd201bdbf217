#include "backend/solver/block_system.h"

#include <algorithm>
#include <cmath>

namespace tutti::internal {

template <int N>
void BlockSystem<N>::Analyse(int size, std::vector<std::pair<int, int>> pairs) {
  pairs_ = std::move(pairs);
  cholesky_.Analyse(size, pairs_);
  has_factor_ = false;
  most_iterations_ = static_cast<int>(std::min(15.0, 0.5 * cholesky_.SolvesPerFactorisation()));
}

template <int N>
bool BlockSystem<N>::Solve(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal,
                           Eigen::VectorXd& b) {
  if (has_factor_ && most_iterations_ > 1 && ConjugateGradients(diagonal, off_diagonal, b)) return true;
  has_factor_ = cholesky_.Factorise(diagonal, off_diagonal);
  if (!has_factor_) return false;
  cholesky_.Solve(b);
  return b.allFinite();
}

template <int N>
bool BlockSystem<N>::ConjugateGradients(const std::vector<Block>& diagonal,
                                        const std::vector<Block>& off_diagonal, Eigen::VectorXd& b) {
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

template <int N>
void BlockSystem<N>::Multiply(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal,
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

template class BlockSystem<3>;
template class BlockSystem<6>;
template class BlockSystem<7>;

}  // namespace tutti::internal
