#include "frontend/map/reduced_system.h"

#include <algorithm>

#include "core/dense_solvers.h"

namespace tutti {

ReducedSystem::ReducedSystem(int cameras, std::vector<std::pair<int, int>> pairs) : cameras_(cameras) {
  if (!IsSparse(cameras)) {
    dense_.resize(6 * cameras + 2, 6 * cameras + 2);
    return;
  }
  for (int c = 0; c < cameras; ++c) pairs.emplace_back(c, c);
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  first_block_.assign(static_cast<std::size_t>(cameras) + 1, 0);
  for (const auto& [a, b] : pairs) {
    ++first_block_[static_cast<std::size_t>(a) + 1];
    column_.push_back(b);
  }
  for (std::size_t c = 1; c < first_block_.size(); ++c) first_block_[c] += first_block_[c - 1];
  blocks_.resize(pairs.size());
  border_.resize(6 * cameras, 2);
}

std::size_t ReducedSystem::Index(int a, int b) const {
  const auto begin = column_.begin() + static_cast<std::ptrdiff_t>(first_block_[static_cast<std::size_t>(a)]);
  const auto end =
      column_.begin() + static_cast<std::ptrdiff_t>(first_block_[static_cast<std::size_t>(a) + 1]);
  return static_cast<std::size_t>(std::lower_bound(begin, end, b) - column_.begin());
}

void ReducedSystem::SetZero() {
  lens_.setZero();
  dense_.setZero();
  border_.setZero();
  for (Matrix6d& block : blocks_) block.setZero();
}

void ReducedSystem::SetDiagonal(int camera, const Matrix6d& block) {
  if (dense_.size() != 0)
    dense_.block<6, 6>(6 * camera, 6 * camera) = block;
  else
    blocks_[Index(camera, camera)] = block;
}

void ReducedSystem::AddLens(int camera, const Eigen::Matrix<double, 2, 6>& block) {
  if (dense_.size() != 0)
    dense_.block<2, 6>(6 * cameras_, 6 * camera) += block;
  else
    border_.block<6, 2>(6 * camera, 0) += block.transpose();
}

bool ReducedSystem::Solve(const Eigen::VectorXd& right, Eigen::VectorXd* solution,
                          Eigen::Matrix2d* lens_information) {
  return dense_.size() != 0 ? SolveDense(right, solution, lens_information)
                            : SolveSparse(right, solution, lens_information);
}

bool ReducedSystem::SolveDense(const Eigen::VectorXd& right, Eigen::VectorXd* solution,
                               Eigen::Matrix2d* lens_information) {
  const Eigen::Index lens_at = 6 * cameras_;
  dense_.block<2, 2>(lens_at, lens_at) = lens_;
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> factor(dense_);
  if (factor.info() != Eigen::Success) return false;
  *solution = factor.solve(right);
  const Eigen::Matrix2d corner =
      factor.matrixLLT().block<2, 2>(lens_at, lens_at).triangularView<Eigen::Lower>();
  *lens_information = corner * corner.transpose();
  return solution->allFinite();
}

void ReducedSystem::FillSparse() {
  const bool first = matrix_.size() == 0;
  if (first) matrix_.resize(6 * cameras_, 6 * cameras_);
  std::vector<Eigen::Triplet<double>> entries;
  double* value = first ? nullptr : matrix_.valuePtr();
  for (int a = 0; a < cameras_; ++a) {
    const std::size_t begin = first_block_[static_cast<std::size_t>(a)],
                      end = first_block_[static_cast<std::size_t>(a) + 1];
    for (int r = 0; r < 6; ++r) {  // row r of the block row is a column of the transpose
      for (std::size_t n = begin; n < end; ++n) {
        const int most = column_[n] == a ? r : 5;
        for (int c = 0; c <= most; ++c) {
          if (first)
            entries.emplace_back(6 * column_[n] + c, 6 * a + r, blocks_[n](r, c));
          else
            *value++ = blocks_[n](r, c);
        }
      }
    }
  }
  if (!first) return;
  matrix_.setFromTriplets(entries.begin(), entries.end());
  factor_ = std::make_unique<Eigen::SimplicialLLT<Sparse, Eigen::Upper>>();
  factor_->analyzePattern(matrix_);
}

bool ReducedSystem::SolveSparse(const Eigen::VectorXd& right, Eigen::VectorXd* solution,
                                Eigen::Matrix2d* lens_information) {
  FillSparse();
  factor_->factorize(matrix_);
  if (factor_->info() != Eigen::Success) return false;
  const Eigen::VectorXd poses = factor_->solve(right.head(6 * cameras_));
  const Eigen::MatrixXd by_lens = factor_->solve(border_);
  *lens_information = lens_ - border_.transpose() * by_lens;
  const Eigen::Vector2d lens =
      internal::SolveLdlt<2>(*lens_information, right.tail<2>() - border_.transpose() * poses);
  solution->resize(right.size());
  *solution << poses - by_lens * lens, lens;
  return solution->allFinite();
}

}  // namespace tutti
