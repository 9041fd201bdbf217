#include "backend/solver/block_system.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace tutti {
namespace {

using Block = internal::BlockSystem<3>::Block;

/// All blocks are there, so that a factorisation takes long and conjugate gradients are worth it.
struct Full {
  static constexpr int kSize = 60;
  std::vector<std::pair<int, int>> pairs;
  std::vector<Block> diagonal, off_diagonal;

  Full() {
    diagonal.assign(kSize, 4 * Block::Identity());
    for (int row = 1; row < kSize; ++row) {
      for (int column = 0; column < row; ++column) {
        Block block;
        block << 1, 0.1, 0, 0.3, -1, 0, 0, 0.2, 0.5;
        pairs.emplace_back(row, column);
        off_diagonal.emplace_back(block * std::sin(row + 2.0 * column) / kSize);
      }
    }
  }
  Eigen::MatrixXd Dense() const {
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(3 * kSize, 3 * kSize);
    for (int k = 0; k < kSize; ++k) out.block<3, 3>(3 * k, 3 * k) = diagonal[static_cast<std::size_t>(k)];
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      out.block<3, 3>(3 * pairs[p].first, 3 * pairs[p].second) = off_diagonal[p];
      out.block<3, 3>(3 * pairs[p].second, 3 * pairs[p].first) = off_diagonal[p].transpose();
    }
    return out;
  }
  /// Error of the system's solution, as a share of the right side.
  double Error(internal::BlockSystem<3>& system) const {
    const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(3 * kSize, -1, 2);
    Eigen::VectorXd x = b;
    if (!system.Solve(diagonal, off_diagonal, x)) return 1;
    return (Dense() * x - b).norm() / b.norm();
  }
};

TEST(BlockSystem, SolvesMatrixAfterMatrixHoweverFarTheyAreApart) {
  Full full;
  internal::BlockSystem<3> system;
  system.Analyse(Full::kSize, full.pairs);
  EXPECT_LT(full.Error(system), 1e-13);
  full.diagonal[3] *= 1.3;
  full.off_diagonal[7] *= 0.9;
  const double close = full.Error(system);
  EXPECT_LT(close, 3e-2);
  EXPECT_GT(close, 1e-12);                                // by conjugate gradients
  for (std::size_t k = 0; k < full.diagonal.size(); ++k)  // too far for conjugate gradients: factorised again
    full.diagonal[k] *= 1 + 1e4 * static_cast<double>(k * k);
  EXPECT_LT(full.Error(system), 1e-12);
}

TEST(BlockSystem, SaysThatAMatrixIsNotPositiveDefinite) {
  Full full;
  internal::BlockSystem<3> system;
  system.Analyse(Full::kSize, full.pairs);
  EXPECT_LT(full.Error(system), 1e-13);
  full.diagonal[3] *= -1;
  EXPECT_EQ(full.Error(system), 1);
  full.diagonal[3] *= -1;
  EXPECT_LT(full.Error(system), 1e-13);
}

}  // namespace
}  // namespace tutti
