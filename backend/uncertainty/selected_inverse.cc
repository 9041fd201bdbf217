#include "backend/uncertainty/selected_inverse.h"

#include <algorithm>
#include <utility>

namespace tutti::internal {

SelectedInverse::SelectedInverse(const Eigen::SparseMatrix<double>& H) {
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor(H);
  ok_ = factor.info() == Eigen::Success;
  if (!ok_) return;
  L_ = factor.matrixL();
  place_ = factor.permutationP().indices();
  Invert();
}

double SelectedInverse::At(int r, int c) const {
  const auto [column, row] = std::minmax(place_[r], place_[c]);
  const int* begin = L_.innerIndexPtr() + L_.outerIndexPtr()[column];
  const int* end = L_.innerIndexPtr() + L_.outerIndexPtr()[column + 1];
  return Z_[static_cast<std::size_t>(std::lower_bound(begin, end, row) - L_.innerIndexPtr())];
}

void SelectedInverse::Invert() {
  Z_.assign(static_cast<std::size_t>(L_.nonZeros()), 0.0);
  const std::size_t n = static_cast<std::size_t>(L_.cols());
  Scratch scratch{std::vector<double>(n, 0.0), std::vector<double>(n, 0.0), std::vector<int>(n, -1)};
  for (int j = static_cast<int>(n) - 1; j >= 0; --j) InvertColumn(j, scratch);
}

void SelectedInverse::InvertColumn(int j, Scratch& scratch) {
  auto& [column, sum, owner] = scratch;
  const int* start = L_.outerIndexPtr();
  const int* row = L_.innerIndexPtr();
  const double* value = L_.valuePtr();
  const auto at = [](int i) { return static_cast<std::size_t>(i); };
  const int diagonal = start[j], end = start[j + 1];
  for (int p = diagonal + 1; p < end; ++p) {
    column[at(row[p])] = value[p];
    sum[at(row[p])] = 0;
    owner[at(row[p])] = j;
  }
  for (int p = diagonal + 1; p < end; ++p) {
    const int k = row[p];
    double own = value[p] * Z_[at(start[k])];
    for (int q = start[k] + 1; q < start[k + 1]; ++q) {
      if (owner[at(row[q])] != j) continue;
      own += column[at(row[q])] * Z_[at(q)];
      sum[at(row[q])] += value[p] * Z_[at(q)];
    }
    sum[at(k)] += own;
  }
  double rest = 1 / value[diagonal];
  for (int p = diagonal + 1; p < end; ++p) {
    Z_[at(p)] = -sum[at(row[p])] / value[diagonal];
    rest -= value[p] * Z_[at(p)];
  }
  Z_[at(diagonal)] = rest / value[diagonal];
}

}  // namespace tutti::internal
