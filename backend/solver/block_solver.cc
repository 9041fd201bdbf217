// Levenberg-Marquardt on a pose graph with a block Cholesky of its own.
//
// The trust region is Ceres' (Marquardt's diagonal scaling; Madsen, Nielsen, Tingleff, Methods for Non-Linear
// Least Squares Problems, 2004), and so is the treatment of losses: all of ours are concave, where Ceres
// re-weights by rho' and leaves rho'' out. The pattern is analysed once for the edges that count.
#include <algorithm>
#include <cmath>
#include <utility>

#include "backend/graph/manifold.h"
#include "backend/solver/block_system.h"
#include "backend/solver/weighted_graph.h"
#include "core/least_squares.h"
#include "core/stopwatch.h"

namespace tutti::internal {
namespace {

/// H = sum of pull J^T J and its gradient over the edges that count, in blocks whose pattern is analysed once
/// for them. What does not count costs nothing.
template <int N>
class BlockEquations {
 public:
  using Block = Eigen::Matrix<double, N, N>;

  /// Edges with two ends that do not move are allowed, they are a part of the cost.
  void Analyse(const WeightedGraph<N>& graph, const std::vector<bool>& counts) {
    const GraphStructure& structure = graph.structure();
    pattern_ = BlockPattern(structure.ends, structure.constant, counts);
    nodes_.clear();
    edges_.clear();
    for (std::size_t k = 0; k < structure.constant.size(); ++k) {
      if (!structure.constant[k]) nodes_.push_back(k);
    }
    for (std::size_t e = 0; e < counts.size(); ++e) {
      if (counts[e]) edges_.push_back(e);
    }
    off_diagonal_.resize(pattern_.pairs.size());
    diagonal_.resize(nodes_.size());
    system_.Analyse(pattern_.unknowns, pattern_.pairs);
  }

  bool Empty() const { return nodes_.empty(); }

  /// Equations at the present poses; returns the cost.
  double Linearise(const WeightedGraph<N>& graph) {
    for (Block& block : diagonal_) block.setZero();
    for (Block& block : off_diagonal_) block.setZero();
    gradient_ = Eigen::VectorXd::Zero(N * pattern_.unknowns);
    double sum = 0;
    for (const std::size_t e : edges_) sum += AddEdge(graph, e);
    return 0.5 * sum;
  }

  double Cost(const WeightedGraph<N>& graph) const {
    double sum = 0, pull = 0;
    for (const std::size_t e : edges_) sum += graph.Loss(e, graph.EdgeChi2(e), pull);
    return 0.5 * sum;
  }

  /// Solves (H + D / radius) step = -gradient, D the diagonal of H. `expected`: by how much the cost falls if
  /// it is as quadratic as it looks. False if the matrix is not positive definite.
  bool FindStep(double radius, double& expected) {
    damped_ = diagonal_;
    Eigen::VectorXd damping(gradient_.size());
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
    before_.resize(nodes_.size() * WeightedGraph<N>::kBlock);
    for (std::size_t k = 0; k < nodes_.size(); ++k) {
      double *block = graph.Block(nodes_[k]), *old = Before(k);
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
    for (std::size_t k = 0; k < nodes_.size(); ++k)
      std::copy_n(Before(k), WeightedGraph<N>::kBlock, graph.Block(nodes_[k]));
  }

  /// Length of the vector of all coordinates of the nodes that move.
  double StateNorm(const WeightedGraph<N>& graph) const {
    double sum = 0;
    for (const std::size_t node : nodes_) {
      for (std::size_t r = 0; r < WeightedGraph<N>::kBlock; ++r)
        sum += graph.Block(node)[r] * graph.Block(node)[r];
    }
    return std::sqrt(sum);
  }

 private:
  double* Before(std::size_t k) { return &before_[k * WeightedGraph<N>::kBlock]; }

  double AddEdge(const WeightedGraph<N>& graph, std::size_t e) {
    const EdgeEnds& ends = graph.structure().ends[e];
    const LinearizedEdge<N> edge = graph.Linearized(e);
    const Block(&J)[2] = edge.jacobian;
    double pull = 1;
    const double cost = graph.Loss(e, edge.error.squaredNorm(), pull);
    const int unknown[2] = {pattern_.unknown[ends.from], pattern_.unknown[ends.to]};
    for (int k = 0; k < 2; ++k) {
      if (unknown[k] < 0) continue;
      const Block weighted = pull * J[k];
      diagonal_[static_cast<std::size_t>(unknown[k])].noalias() += weighted.transpose() * J[k];
      gradient_.template segment<N>(N * unknown[k]).noalias() += weighted.transpose() * edge.error;
    }
    if (unknown[0] < 0 || unknown[1] < 0) return cost;
    const int row = unknown[0] > unknown[1] ? 0 : 1;  // as the pairs are: the larger one first
    const Block weighted = pull * J[row];
    off_diagonal_[pattern_.pair_of_edge[e]].noalias() += weighted.transpose() * J[1 - row];
    return cost;
  }

  std::vector<std::size_t> nodes_, edges_;  // that move, that count
  BlockPattern pattern_;
  std::vector<Block> diagonal_, damped_, off_diagonal_;
  Eigen::VectorXd gradient_, step_;
  std::vector<double> before_;  // blocks of the nodes before the step
  BlockSystem<N> system_;
};

/// Levenberg-Marquardt on the edges that the equations were analysed for.
template <int N>
class LevenbergMarquardt {
 public:
  LevenbergMarquardt(WeightedGraph<N>& graph, BlockEquations<N>& equations, const SolveLimits& limits)
      : graph_(graph), equations_(equations), limits_(limits) {}

  SolveSummary Minimise() {
    const Stopwatch watch;
    out_.usable = true;
    region_.radius = limits_.trust_region;
    while (out_.usable && !out_.converged && out_.iterations < limits_.max_iterations) {
      if (limits_.max_time_s > 0 && watch.Seconds() >= limits_.max_time_s) break;
      ThrowIfStopped(limits_.stop);
      if (!linearised_) Linearise();
      if (!out_.usable || out_.converged) break;
      ++out_.iterations;
      Iterate();
    }
    out_.trust_region = region_.radius;
    return out_;
  }

 private:
  static constexpr double kParameterTolerance = 1e-14;
  static constexpr double kRounding = 1e-15;   // relative error of a cost
  static constexpr double kMinQuality = 1e-3;  // least share of the expected decrease that makes a step

  void Linearise() {
    linearised_ = true;
    cost_ = equations_.Linearise(graph_);
    out_.usable = std::isfinite(cost_);
    if (!out_.usable) out_.message = "block solver: the cost is not finite";
    out_.converged = equations_.Empty();
  }

  void Iterate() {
    double expected = 0;
    if (!equations_.FindStep(region_.radius, expected)) {
      out_.usable = region_.Shrink();
      if (!out_.usable) out_.message = "block solver: the normal equations have no solution";
      return;
    }
    const double length = equations_.step().norm();
    if (length <= kParameterTolerance * (equations_.StateNorm(graph_) + kParameterTolerance)) {
      out_.converged = true;
      return;
    }
    equations_.Move(graph_);
    const double after = equations_.Cost(graph_);
    const double change = cost_ - after;
    const bool better = std::isfinite(change) && change > kMinQuality * expected;
    const bool flat = std::abs(change) <= std::max(limits_.function_tolerance, kRounding) * cost_;
    const bool stays = better || (flat && change > 0);
    if (!stays) equations_.TakeBack(graph_);
    linearised_ = !stays;  // still, at the old poses
    if (flat) {
      out_.converged = true;
    } else if (better) {
      region_.Grow(change / expected);
      cost_ = after;
    } else {
      out_.converged = !region_.Shrink();  // no step is small enough to lower the cost
    }
  }

  WeightedGraph<N>& graph_;
  BlockEquations<N>& equations_;
  const SolveLimits& limits_;
  TrustRegion region_;
  SolveSummary out_;
  bool linearised_ = false;  // where the graph is now
  double cost_ = 0;
};

template <int N>
class BlockSolver final : public GraphSolver<N> {
 public:
  SolveSummary Solve(WeightedGraph<N>& graph, const SolveLimits& limits) override {
    std::vector<bool> counts = graph.Active();
    if (!analysed_ || counts != counts_) equations_.Analyse(graph, counts);
    analysed_ = true;
    counts_ = std::move(counts);
    return LevenbergMarquardt<N>(graph, equations_, limits).Minimise();
  }

 private:
  bool analysed_ = false;
  std::vector<bool> counts_;  // edges of the analysed pattern
  BlockEquations<N> equations_;
};

}  // namespace

template <int N>
std::unique_ptr<GraphSolver<N>> MakeBlockSolver() {
  return std::make_unique<BlockSolver<N>>();
}

template std::unique_ptr<GraphSolver<3>> MakeBlockSolver<3>();
template std::unique_ptr<GraphSolver<6>> MakeBlockSolver<6>();
template std::unique_ptr<GraphSolver<7>> MakeBlockSolver<7>();

}  // namespace tutti::internal
