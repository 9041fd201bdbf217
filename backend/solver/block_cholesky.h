// Cholesky factorisation of a sparse symmetric matrix of N x N blocks. Private to the back end.
//
// The blocks of a pose graph have 3 to 7 rows: too small for the dense kernels of supernodal libraries, a
// waste of indices for scalar ones. Here the analysis runs on the graph of the blocks, stays valid while the
// edges stay, and the bits depend on no BLAS and no OpenMP. Up-looking: Davis, Direct Methods for Sparse
// Linear Systems, SIAM 2006, chapter 4, with blocks in place of numbers.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "backend/graph/graph_structure.h"

namespace tutti::internal {

/// One diagonal block for each unknown, one block below the diagonal for each pair of them that edges join.
struct BlockPattern {
  int unknowns = 0;                        ///< before what counts them
  std::vector<int> unknown;                ///< parallel to nodes; -1: does not move
  std::vector<std::pair<int, int>> pairs;  ///< of unknowns, the larger one first; ascending, each once
  std::vector<std::size_t> pair_of_edge;   ///< parallel to edges; 0 where an end does not move

  BlockPattern() = default;
  /// `constant` is parallel to the nodes, `counts` to the edges.
  BlockPattern(const std::vector<EdgeEnds>& ends, const std::vector<bool>& constant,
               const std::vector<bool>& counts)
      : unknown(NumberUnknowns(constant, unknowns)), pair_of_edge(ends.size(), 0) {
    std::vector<std::pair<std::pair<int, int>, std::size_t>> sorted;  // pair, edge
    for (std::size_t e = 0; e < ends.size(); ++e) {
      const int i = unknown[ends[e].from], j = unknown[ends[e].to];
      if (counts[e] && i >= 0 && j >= 0) sorted.push_back({{std::max(i, j), std::min(i, j)}, e});
    }
    std::sort(sorted.begin(), sorted.end());
    for (const auto& [pair, e] : sorted) {
      if (pairs.empty() || pairs.back() != pair) pairs.push_back(pair);
      pair_of_edge[e] = pairs.size() - 1;
    }
  }
};

template <int N>
class BlockCholesky {
 public:
  using Block = Eigen::Matrix<double, N, N>;

  /// Minimum-degree order and the pattern of the factor. `pairs`: the off-diagonal blocks that are not zero,
  /// (row, column) with row != column; one triangle only, each once.
  void Analyse(int size, const std::vector<std::pair<int, int>>& pairs);

  std::size_t size() const { return order_.size(); }
  /// Blocks below the diagonal of the factor.
  std::size_t FactorBlocks() const { return rows_.size(); }

  /// How many times Solve() could be called while Factorise() runs, by their numbers of products; those of
  /// the latter run about twice as fast.
  double SolvesPerFactorisation() const;

  /// `off_diagonal` is parallel to the analysed pairs. False if the matrix is not positive definite.
  bool Factorise(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal);

  /// Solves in place; blocks of `b` in the caller's order.
  void Solve(Eigen::VectorXd& b) const { SolveInPlace(Eigen::Map<Columns<1>>(b.data(), b.size(), 1)); }
  /// The same for N + 2 right-hand sides at once, the rows of `b` one after the other: less than half the
  /// time of as many.
  void SolveMany(double* b) const {
    SolveInPlace(Eigen::Map<Columns<N + 2>>(b, static_cast<Eigen::Index>(N * size()), N + 2));
  }

 private:
  /// One given block of a row, left of the diagonal.
  struct Entry {
    std::size_t column, pair;
    bool transposed;
  };

  template <int Sides>
  using Columns =
      Eigen::Matrix<double, Eigen::Dynamic, Sides, Sides == 1 ? Eigen::ColMajor : Eigen::RowMajor>;

  template <typename Sides>
  static auto Segment(Sides& v, std::size_t k) {
    return v.template middleRows<N>(static_cast<Eigen::Index>(N * k));
  }
  template <int Sides>
  void SolveInPlace(Eigen::Map<Columns<Sides>> b) const;

  /// Inverse of the lower triangle; the upper one is not looked at. (Eigen's own goes the way of large
  /// matrices.)
  static Block InverseOfLower(const Block& L);
  /// L of a = L L^T in the lower triangle, the upper one stays; false if `a` is not positive definite.
  static bool LowerCholesky(Block& a);

  void Order(int size, const std::vector<std::pair<int, int>>& pairs);
  void SortIntoRows(const std::vector<std::pair<int, int>>& pairs);
  std::size_t Place(int old) const { return place_[static_cast<std::size_t>(old)]; }

  /// Elimination tree and, row by row, the columns that it reaches.
  void FindPattern();

  std::vector<std::size_t> order_, place_;  // new -> old, old -> new
  std::vector<std::size_t> entry_begin_;    // given blocks by row
  std::vector<Entry> entries_;
  std::vector<std::size_t> row_begin_, row_columns_;  // pattern of the factor by rows
  std::vector<std::size_t> column_begin_, rows_;      // and by columns
  std::vector<Block> values_;                         // parallel to rows_
  std::vector<Block> diagonal_inverse_, work_;
};

extern template class BlockCholesky<3>;
extern template class BlockCholesky<4>;
extern template class BlockCholesky<6>;
extern template class BlockCholesky<7>;

}  // namespace tutti::internal
