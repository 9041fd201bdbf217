#include "backend/uncertainty/edge_prediction.h"

#include <Eigen/Cholesky>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>

#include "backend/solver/weighted_graph.h"

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

}  // namespace

std::unique_ptr<EdgePrediction> MakeEdgePrediction(const GraphProblem& problem) {
  return WithDimension(problem, [](const auto& as) -> std::unique_ptr<EdgePrediction> {
    return std::make_unique<EdgePredictionOf<std::decay_t<decltype(as)>::kDimension>>(as);
  });
}

}  // namespace tutti::internal
