#include "backend/solver/block_cholesky.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

namespace tutti::internal {

template <int N>
void BlockCholesky<N>::Analyse(int size, const std::vector<std::pair<int, int>>& pairs) {
  Order(size, pairs);
  SortIntoRows(pairs);
  FindPattern();
  diagonal_inverse_.resize(static_cast<std::size_t>(size));
  work_.resize(static_cast<std::size_t>(size));
  values_.resize(rows_.size());
}

template <int N>
double BlockCholesky<N>::SolvesPerFactorisation() const {
  double blocks = 0, products = 0;
  for (std::size_t k = 0; k < size(); ++k) {
    const auto column = static_cast<double>(column_begin_[k + 1] - column_begin_[k]);
    blocks += column + 1;
    products += (column + 1) * (column + 1);
  }
  return blocks > 0 ? 0.5 * N * products / (4 * blocks) : 0;
}

template <int N>
bool BlockCholesky<N>::Factorise(const std::vector<Block>& diagonal, const std::vector<Block>& off_diagonal) {
  std::vector<std::size_t> end(column_begin_.begin(), column_begin_.end() - 1);
  for (std::size_t k = 0; k < size(); ++k) {
    for (std::size_t p = row_begin_[k]; p < row_begin_[k + 1]; ++p) work_[row_columns_[p]].setZero();
    for (std::size_t p = entry_begin_[k]; p < entry_begin_[k + 1]; ++p) {
      const Entry& entry = entries_[p];
      if (entry.transposed) {
        work_[entry.column] = off_diagonal[entry.pair].transpose();
      } else {
        work_[entry.column] = off_diagonal[entry.pair];
      }
    }
    Block pivot = diagonal[order_[k]];
    for (std::size_t p = row_begin_[k]; p < row_begin_[k + 1]; ++p) {
      const std::size_t i = row_columns_[p];
      const Block L = work_[i] * diagonal_inverse_[i].transpose();
      for (std::size_t q = column_begin_[i]; q < end[i]; ++q) {
        work_[rows_[q]].noalias() -= L * values_[q].transpose();
      }
      pivot.noalias() -= L * L.transpose();
      values_[end[i]++] = L;
    }
    if (!LowerCholesky(pivot)) return false;
    diagonal_inverse_[k] = InverseOfLower(pivot);
    if (!diagonal_inverse_[k].allFinite()) return false;
  }
  return true;
}

template <int N>
template <int Sides>
void BlockCholesky<N>::SolveInPlace(Eigen::Map<Columns<Sides>> b) const {
  Columns<Sides> y(b.rows(), b.cols());
  for (std::size_t k = 0; k < size(); ++k) Segment(y, k) = Segment(b, order_[k]);
  for (std::size_t k = 0; k < size(); ++k) {
    Segment(y, k) = (diagonal_inverse_[k] * Segment(y, k)).eval();
    for (std::size_t q = column_begin_[k]; q < column_begin_[k + 1]; ++q) {
      Segment(y, rows_[q]).noalias() -= values_[q] * Segment(y, k);
    }
  }
  for (std::size_t k = size(); k-- > 0;) {
    for (std::size_t q = column_begin_[k]; q < column_begin_[k + 1]; ++q) {
      Segment(y, k).noalias() -= values_[q].transpose() * Segment(y, rows_[q]);
    }
    Segment(y, k) = (diagonal_inverse_[k].transpose() * Segment(y, k)).eval();
  }
  for (std::size_t k = 0; k < size(); ++k) Segment(b, order_[k]) = Segment(y, k);
}

template <int N>
bool BlockCholesky<N>::LowerCholesky(Block& a) {
  for (int c = 0; c < N; ++c) {
    double pivot = 0;
    for (int k = 0; k < c; ++k) pivot += a(c, k) * a(c, k);
    pivot = a(c, c) - pivot;
    if (pivot <= 0) return false;
    a(c, c) = std::sqrt(pivot);
    for (int r = c + 1; r < N; ++r) {
      double sum = 0;
      for (int k = 0; k < c; ++k) sum += a(r, k) * a(c, k);
      a(r, c) = (a(r, c) - sum) / a(c, c);
    }
  }
  return true;
}

template <int N>
typename BlockCholesky<N>::Block BlockCholesky<N>::InverseOfLower(const Block& L) {
  Block inverse = Block::Zero();
  for (int c = 0; c < N; ++c) {
    inverse(c, c) = 1 / L(c, c);
    for (int r = c + 1; r < N; ++r) {
      double sum = 0;
      for (int k = c; k < r; ++k) sum += L(r, k) * inverse(k, c);
      inverse(r, c) = -sum / L(r, r);
    }
  }
  return inverse;
}

template <int N>
void BlockCholesky<N>::Order(int size, const std::vector<std::pair<int, int>>& pairs) {
  std::vector<Eigen::Triplet<double>> triplets;
  triplets.reserve(static_cast<std::size_t>(size) + 2 * pairs.size());
  for (int k = 0; k < size; ++k) triplets.emplace_back(k, k, 1.0);
  for (const auto& [row, column] : pairs) {
    triplets.emplace_back(row, column, 1.0);
    triplets.emplace_back(column, row, 1.0);
  }
  Eigen::SparseMatrix<double> pattern(size, size);
  pattern.setFromTriplets(triplets.begin(), triplets.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> permutation;
  Eigen::AMDOrdering<int>()(pattern, permutation);
  order_.resize(static_cast<std::size_t>(size));
  place_.resize(order_.size());
  for (int k = 0; k < size; ++k) {
    const auto old = static_cast<std::size_t>(permutation.indices()(k));
    order_[static_cast<std::size_t>(k)] = old;
    place_[old] = static_cast<std::size_t>(k);
  }
}

template <int N>
void BlockCholesky<N>::SortIntoRows(const std::vector<std::pair<int, int>>& pairs) {
  entry_begin_.assign(size() + 1, 0);
  entries_.resize(pairs.size());
  for (const auto& [a, b] : pairs) ++entry_begin_[std::max(Place(a), Place(b)) + 1];
  for (std::size_t k = 0; k < size(); ++k) entry_begin_[k + 1] += entry_begin_[k];
  std::vector<std::size_t> next(entry_begin_.begin(), entry_begin_.end() - 1);
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    const std::size_t a = Place(pairs[p].first), b = Place(pairs[p].second);
    entries_[next[std::max(a, b)]++] = {std::min(a, b), p, a < b};
  }
}

template <int N>
void BlockCholesky<N>::FindPattern() {
  const std::size_t none = size();
  std::vector<std::size_t> parent(size(), none), mark(size(), none), count(size() + 1, 0);
  row_begin_.assign(1, 0);
  row_columns_.clear();
  for (std::size_t k = 0; k < size(); ++k) {
    mark[k] = k;
    for (std::size_t p = entry_begin_[k]; p < entry_begin_[k + 1]; ++p) {
      for (std::size_t i = entries_[p].column; mark[i] != k; i = parent[i]) {
        if (parent[i] == none) parent[i] = k;
        mark[i] = k;
        row_columns_.push_back(i);
        ++count[i + 1];
      }
    }
    std::sort(row_columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[k]), row_columns_.end());
    row_begin_.push_back(row_columns_.size());
  }
  column_begin_ = std::move(count);
  for (std::size_t k = 0; k < size(); ++k) column_begin_[k + 1] += column_begin_[k];
  rows_.resize(row_columns_.size());
  std::vector<std::size_t> next(column_begin_.begin(), column_begin_.end() - 1);
  for (std::size_t k = 0; k < size(); ++k) {
    for (std::size_t p = row_begin_[k]; p < row_begin_[k + 1]; ++p) rows_[next[row_columns_[p]]++] = k;
  }
}

template class BlockCholesky<3>;
template class BlockCholesky<4>;
template class BlockCholesky<6>;
template class BlockCholesky<7>;
template void BlockCholesky<3>::SolveInPlace(Eigen::Map<Columns<1>>) const;
template void BlockCholesky<3>::SolveInPlace(Eigen::Map<Columns<5>>) const;
template void BlockCholesky<4>::SolveInPlace(Eigen::Map<Columns<1>>) const;
template void BlockCholesky<4>::SolveInPlace(Eigen::Map<Columns<6>>) const;
template void BlockCholesky<6>::SolveInPlace(Eigen::Map<Columns<1>>) const;
template void BlockCholesky<7>::SolveInPlace(Eigen::Map<Columns<1>>) const;

}  // namespace tutti::internal
