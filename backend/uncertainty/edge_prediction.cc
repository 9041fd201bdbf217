#include "backend/uncertainty/edge_prediction.h"

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "backend/solver/weighted_graph.h"
#include "backend/uncertainty/selected_inverse.h"
#include "core/dense_solvers.h"

namespace tutti::internal {

namespace {

template <int N>
class EdgePredictionOf final : public EdgePrediction {
 public:
  explicit EdgePredictionOf(const WeightedGraph<N>& problem)
      : problem_(problem), unknown_(NumberUnknowns(problem.structure().constant, unknowns_)) {}

  bool Update() override {
    const Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> factor(problem_.InformationMatrix(unknown_));
    if (factor.info() != Eigen::Success) return false;
    L_ = factor.matrixL();
    place_ = factor.permutationP().indices();
    solution_.assign(At(N * unknowns_), Row::Zero());
    reached_.assign(At(N * unknowns_), false);
    return true;
  }

  PredictedEdge Of(std::size_t e) override {
    const LinearizedEdge<N> edge = problem_.Linearized(e);
    const auto [from, to] = problem_.structure().ends[e];
    const std::size_t ends[2] = {from, to};
    std::vector<int> columns;
    for (int a = 0; a < 2; ++a) {
      for (int k = 0; k < N && unknown_[ends[a]] >= 0; ++k) {
        const int place = place_[N * unknown_[ends[a]] + k];
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

 private:
  using Square = Eigen::Matrix<double, N, N>;
  using Row = Eigen::Matrix<double, 1, N>;
  static std::size_t At(int k) { return static_cast<std::size_t>(k); }

  /// The way from a column to the root, as far as it is new.
  void ClimbFrom(int column, std::vector<int>& columns) {
    while (!reached_[At(column)]) {
      reached_[At(column)] = true;
      columns.push_back(column);
      const int below = L_.outerIndexPtr()[column] + 1;
      if (below == L_.outerIndexPtr()[column + 1]) return;
      column = L_.innerIndexPtr()[below];
    }
  }

  void Eliminate(int column) {
    const int begin = L_.outerIndexPtr()[column], end = L_.outerIndexPtr()[column + 1];
    const Row value = solution_[At(column)] / L_.valuePtr()[begin];
    solution_[At(column)] = value;
    for (int k = begin + 1; k < end; ++k) solution_[At(L_.innerIndexPtr()[k])] -= L_.valuePtr()[k] * value;
  }

  const WeightedGraph<N>& problem_;
  int unknowns_ = 0;
  std::vector<int> unknown_;
  Eigen::SparseMatrix<double> L_;  // the factor, permuted
  Eigen::VectorXi place_;          // of each row of H in L
  std::vector<Row> solution_;      // zero between calls
  std::vector<bool> reached_;      // false between calls
};

template <int N>
class LeaveOneOut {
 public:
  explicit LeaveOneOut(const WeightedGraph<N>& problem)
      : problem_(problem),
        unknown_(NumberUnknowns(problem.structure().constant, unknowns_)),
        inverse_(problem.InformationMatrix(unknown_)) {}

  bool Ok() const { return inverse_.Ok(); }

  double Chi2(std::size_t e) const {
    const LinearizedEdge<N> edge = problem_.Linearized(e);
    const auto [from, to] = problem_.structure().ends[e];
    const int at[2] = {unknown_[from], unknown_[to]};
    Square P = Square::Zero();
    for (int a = 0; a < 2; ++a) {
      for (int b = 0; b < 2; ++b) {
        if (at[a] >= 0 && at[b] >= 0)
          P += edge.jacobian[a] * Covariance(N * at[a], N * at[b]) * edge.jacobian[b].transpose();
      }
    }
    const Eigenpairs eigen = SymmetricEigen(P);
    const Eigen::Matrix<double, N, 1> error = eigen.vectors.transpose() * edge.error;
    double sum = 0;
    for (int k = 0; k < N; ++k) {
      const double rest = 1 - eigen.values(k);
      if (rest > kLeastHold) sum += error(k) * error(k) / rest;
    }
    return sum;
  }

 private:
  using Square = Eigen::Matrix<double, N, N>;
  static constexpr double kLeastHold = 1e-6;  // below it rounding decides

  Square Covariance(int r, int c) const {
    Square out;
    for (int i = 0; i < N; ++i) {
      for (int k = 0; k < N; ++k) out(i, k) = inverse_.At(r + i, c + k);
    }
    return out;
  }

  const WeightedGraph<N>& problem_;
  int unknowns_ = 0;
  std::vector<int> unknown_;
  SelectedInverse inverse_;
};

}  // namespace

std::unique_ptr<EdgePrediction> MakeEdgePrediction(const GraphProblem& problem) {
  return WithDimension(problem, [](const auto& as) -> std::unique_ptr<EdgePrediction> {
    return std::make_unique<EdgePredictionOf<std::decay_t<decltype(as)>::kDimension>>(as);
  });
}

std::vector<double> LeaveOneOutChi2(const GraphProblem& problem, const std::vector<std::size_t>& edges) {
  return WithDimension(problem, [&](const auto& as) {
    const LeaveOneOut<std::decay_t<decltype(as)>::kDimension> without(as);
    std::vector<double> out;
    for (std::size_t k = 0; without.Ok() && k < edges.size(); ++k) out.push_back(without.Chi2(edges[k]));
    return out;
  });
}

}  // namespace tutti::internal
