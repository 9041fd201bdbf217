#include "backend/uncertainty/edge_prediction.h"

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "backend/solver/linearized_edge.h"

namespace tutti::internal {

template <int N>
EdgePrediction<N>::EdgePrediction(const GraphProblem<N>& problem)
    : problem_(problem), row_(NumberRows<N>(problem.structure().constant, size_)) {}

template <int N>
bool EdgePrediction<N>::Update() {
  std::vector<Eigen::Triplet<double>> triplets;
  for (std::size_t e = 0; e < problem_.structure().ends.size(); ++e) {
    if (problem_.weight(e) == 0) continue;
    const auto [from, to] = problem_.structure().ends[e];
    AddInformation<N>(problem_.Linearized(e), {row_[from], row_[to]}, triplets);
  }
  Eigen::SparseMatrix<double> H(size_, size_);
  H.setFromTriplets(triplets.begin(), triplets.end());
  const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor(H);
  if (factor.info() != Eigen::Success) return false;
  L_ = factor.matrixL();
  place_ = factor.permutationP().indices();
  solution_.assign(static_cast<std::size_t>(size_), Row::Zero());
  reached_.assign(static_cast<std::size_t>(size_), false);
  return true;
}

template <int N>
PredictedEdge EdgePrediction<N>::Of(std::size_t e) {
  const LinearizedEdge<N> edge = problem_.Linearized(e);
  const auto [from, to] = problem_.structure().ends[e];
  const std::size_t ends[2] = {from, to};
  std::vector<int> columns;
  for (int a = 0; a < 2; ++a) {
    for (int k = 0; k < N && row_[ends[a]] >= 0; ++k) {
      const int place = place_[row_[ends[a]] + k];
      ClimbFrom(place, columns);
      solution_[At(place)] += edge.jacobian[a].col(k).transpose();
    }
  }
  std::sort(columns.begin(), columns.end());
  Square S = Square::Identity();
  for (const int column : columns) {
    Eliminate(column);
    S += solution_[At(column)].transpose() * solution_[At(column)];
  }
  for (const int column : columns) {
    solution_[At(column)].setZero();
    reached_[At(column)] = false;
  }
  const Eigen::LLT<Square> factor(S);
  return {edge.error.dot(factor.solve(edge.error)), 2 * factor.matrixLLT().diagonal().array().log().sum()};
}

template <int N>
void EdgePrediction<N>::ClimbFrom(int column, std::vector<int>& columns) {
  while (!reached_[At(column)]) {
    reached_[At(column)] = true;
    columns.push_back(column);
    const int below = L_.outerIndexPtr()[column] + 1;
    if (below == L_.outerIndexPtr()[column + 1]) return;
    column = L_.innerIndexPtr()[below];
  }
}

template <int N>
void EdgePrediction<N>::Eliminate(int column) {
  const int begin = L_.outerIndexPtr()[column], end = L_.outerIndexPtr()[column + 1];
  const Row value = solution_[At(column)] / L_.valuePtr()[begin];
  solution_[At(column)] = value;
  for (int k = begin + 1; k < end; ++k) solution_[At(L_.innerIndexPtr()[k])] -= L_.valuePtr()[k] * value;
}

template class EdgePrediction<3>;
template class EdgePrediction<6>;
template class EdgePrediction<7>;

}  // namespace tutti::internal
