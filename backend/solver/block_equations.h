// Normal equations of a pose graph, or of a part of it, in blocks. Private to the back end.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "backend/graph/manifold.h"
#include "backend/solver/block_pattern.h"
#include "backend/solver/block_system.h"
#include "backend/solver/graph_solver.h"

namespace tutti::internal {

/// Positions of the nodes that may move, and of the edges that count.
struct ActiveSet {
  std::vector<std::size_t> nodes, edges;
};

/// H = sum of pull J^T J and its gradient, kept in blocks whose pattern is analysed once for an active set.
/// What does not belong to the set costs nothing.
template <int N>
class BlockEquations {
 public:
  using Block = Eigen::Matrix<double, N, N>;
  using Error = Eigen::Matrix<double, N, 1>;

  /// Edges with two ends that do not move are allowed, they are a part of the cost.
  void Analyse(const WeightedGraph<N>& graph, ActiveSet active) {
    active_ = std::move(active);
    const GraphStructure& structure = *graph.structure;
    pattern_ = BlockPattern(structure.ends, active_.edges, active_.nodes, structure.constant.size());
    off_diagonal_.resize(pattern_.pairs.size());
    diagonal_.resize(active_.nodes.size());
    system_.Analyse(Count(), pattern_.pairs);
  }

  const ActiveSet& active() const { return active_; }

  /// Equations at the present poses; returns the cost of the active edges.
  double Linearise(const WeightedGraph<N>& graph) {
    for (Block& block : diagonal_) block.setZero();
    for (Block& block : off_diagonal_) block.setZero();
    gradient_ = Eigen::VectorXd::Zero(N * Count());
    double sum = 0;
    for (std::size_t p = 0; p < active_.edges.size(); ++p) sum += AddEdge(graph, p);
    return 0.5 * sum;
  }

  double Cost(const WeightedGraph<N>& graph) const {
    double sum = 0, pull = 0;
    for (const std::size_t e : active_.edges) sum += graph.Loss(e, graph.Chi2(e), pull);
    return 0.5 * sum;
  }

  /// Solves (H + D / radius) step = -gradient, D the diagonal of H. `expected`: by how much the cost falls if
  /// it is as quadratic as it looks. False if the matrix is not positive definite.
  bool FindStep(double radius, double& expected) {
    damped_ = diagonal_;
    Eigen::VectorXd damping(N * Count());
    for (std::size_t k = 0; k < damped_.size(); ++k) {
      for (int r = 0; r < N; ++r) {
        const double d = std::clamp(diagonal_[k](r, r), 1e-6, 1e32) / radius;
        damped_[k](r, r) += d;
        damping(N * static_cast<Eigen::Index>(k) + r) = d;
      }
    }
    step_ = -gradient_;
    if (!system_.Solve(damped_, off_diagonal_, step_)) return false;
    expected = 0.5 * (step_.dot(damping.cwiseProduct(step_)) - gradient_.dot(step_));
    return true;
  }

  const Eigen::VectorXd& step() const { return step_; }

  /// Takes the step; TakeBack() undoes it to the bit.
  void Move(WeightedGraph<N>& graph) {
    before_.resize(active_.nodes.size() * WeightedGraph<N>::kBlock);
    for (std::size_t k = 0; k < active_.nodes.size(); ++k) {
      double *block = graph.Block(active_.nodes[k]), *old = Before(k);
      std::copy_n(block, WeightedGraph<N>::kBlock, old);
      const double* delta = step_.data() + N * static_cast<Eigen::Index>(k);
      if constexpr (N == 3) {
        for (int r = 0; r < 3; ++r) block[r] = old[r] + delta[r];
      } else {
        NodeManifold<N - 3>().Plus(old, delta, block);
      }
    }
  }
  void TakeBack(WeightedGraph<N>& graph) {
    for (std::size_t k = 0; k < active_.nodes.size(); ++k)
      std::copy_n(Before(k), WeightedGraph<N>::kBlock, graph.Block(active_.nodes[k]));
  }

  /// Length of the vector of all coordinates of the active nodes.
  double StateNorm(const WeightedGraph<N>& graph) const {
    double sum = 0;
    for (const std::size_t node : active_.nodes) {
      for (std::size_t r = 0; r < WeightedGraph<N>::kBlock; ++r) {
        sum += graph.Block(node)[r] * graph.Block(node)[r];
      }
    }
    return std::sqrt(sum);
  }

 private:
  int Count() const { return static_cast<int>(active_.nodes.size()); }
  double* Before(std::size_t k) { return &before_[k * WeightedGraph<N>::kBlock]; }

  double AddEdge(const WeightedGraph<N>& graph, std::size_t p) {
    const std::size_t e = active_.edges[p];
    const EdgeEnds& ends = graph.structure->ends[e];
    Error r;
    Block J[2];
    graph.Whitened(e, r, &J[0], &J[1]);
    double pull = 1;
    const double cost = graph.Loss(e, r.squaredNorm(), pull);
    const int unknown[2] = {pattern_.unknown[ends.from], pattern_.unknown[ends.to]};
    for (int k = 0; k < 2; ++k) {
      if (unknown[k] < 0) continue;
      const Block weighted = pull * J[k];
      diagonal_[static_cast<std::size_t>(unknown[k])].noalias() += weighted.transpose() * J[k];
      gradient_.template segment<N>(N * unknown[k]).noalias() += weighted.transpose() * r;
    }
    if (unknown[0] < 0 || unknown[1] < 0) return cost;
    const int row = unknown[0] > unknown[1] ? 0 : 1;  // as the pairs are: the larger one first
    const Block weighted = pull * J[row];
    off_diagonal_[pattern_.pair_of_edge[p]].noalias() += weighted.transpose() * J[1 - row];
    return cost;
  }

  ActiveSet active_;
  BlockPattern pattern_;
  std::vector<Block> diagonal_, damped_, off_diagonal_;
  Eigen::VectorXd gradient_, step_;
  std::vector<double> before_;  // blocks of the active nodes before the step
  BlockSystem<N> system_;
};

}  // namespace tutti::internal
