#include "backend/solver/block_cholesky.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

namespace tutti {
namespace {

using Pairs = std::vector<std::pair<int, int>>;

/// A random sparse positive definite matrix, in blocks and dense.
template <int N>
struct Problem {
  using Block = typename internal::BlockCholesky<N>::Block;
  Pairs pairs;
  std::vector<Block> diagonal, off_diagonal;
  Eigen::MatrixXd dense;

  Problem(int size, int extra, unsigned seed) : dense(Eigen::MatrixXd::Zero(N * size, N * size)) {
    std::mt19937 random(seed);
    const auto number = [&] { return static_cast<double>(random()) / 4294967296.0 - 0.5; };
    for (int k = 1; k < size; ++k) pairs.emplace_back(k, k - 1);
    for (int k = 0; k < extra; ++k) {
      const int a = static_cast<int>(random() % static_cast<unsigned>(size));
      const int b = static_cast<int>(random() % static_cast<unsigned>(size));
      const auto same = [&](const auto& p) { return std::minmax(p.first, p.second) == std::minmax(a, b); };
      if (a != b && std::none_of(pairs.begin(), pairs.end(), same)) pairs.emplace_back(a, b);
    }
    diagonal.assign(static_cast<std::size_t>(size), Block::Identity() * (2.0 * N));
    for (const auto& [row, column] : pairs) {
      off_diagonal.push_back(Block::NullaryExpr([&](auto, auto) { return number(); }));
      dense.block<N, N>(N * row, N * column) = off_diagonal.back();
      dense.block<N, N>(N * column, N * row) = off_diagonal.back().transpose();
      for (int node : {row, column}) diagonal[static_cast<std::size_t>(node)] += N * Block::Identity();
    }
    for (int k = 0; k < size; ++k) dense.block<N, N>(N * k, N * k) = diagonal[static_cast<std::size_t>(k)];
  }
};

template <int N>
void SolvesAsADenseFactorisation() {
  for (unsigned seed : {1u, 2u, 3u}) {
    Problem<N> problem(40, 60, seed);
    internal::BlockCholesky<N> cholesky;
    cholesky.Analyse(40, problem.pairs);  // once for many factorisations
    for (const double scale : {1.0, 4.0, 0.25}) {
      for (auto& block : problem.diagonal) block *= scale;
      for (auto& block : problem.off_diagonal) block *= scale;
      problem.dense *= scale;
      ASSERT_TRUE(cholesky.Factorise(problem.diagonal, problem.off_diagonal));
      const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(40 * N, -1, 2);
      Eigen::VectorXd x = b;
      cholesky.Solve(x);
      EXPECT_LT((problem.dense * x - b).norm(), 1e-11 * b.norm()) << N << " " << seed << " " << scale;
    }
  }
}

TEST(BlockCholesky, SolvesAsADenseFactorisationForEveryBlockSize) {
  SolvesAsADenseFactorisation<3>();
  SolvesAsADenseFactorisation<6>();
  SolvesAsADenseFactorisation<7>();
}

TEST(BlockCholesky, SaysThatAMatrixIsNotPositiveDefinite) {
  Problem<6> problem(10, 5, 1);
  internal::BlockCholesky<6> cholesky;
  cholesky.Analyse(10, problem.pairs);
  problem.diagonal[4] = -problem.diagonal[4];
  EXPECT_FALSE(cholesky.Factorise(problem.diagonal, problem.off_diagonal));
  problem.diagonal[4].setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(cholesky.Factorise(problem.diagonal, problem.off_diagonal));
}

TEST(BlockCholesky, TheFactorOfAChainHasNoFill) {
  const Problem<3> problem(100, 0, 1);
  internal::BlockCholesky<3> cholesky;
  cholesky.Analyse(100, problem.pairs);
  EXPECT_EQ(cholesky.FactorBlocks(), 99u);
}

TEST(BlockCholesky, NothingToSolveIsNoError) {
  internal::BlockCholesky<3> cholesky;
  cholesky.Analyse(0, {});
  EXPECT_TRUE(cholesky.Factorise({}, {}));
  Eigen::VectorXd nothing;
  cholesky.Solve(nothing);
}

}  // namespace
}  // namespace tutti
