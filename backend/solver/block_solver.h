// Levenberg-Marquardt on a pose graph with a block Cholesky of its own. Private to the back end.
//
// The trust region is Ceres' (Marquardt's diagonal scaling; Madsen, Nielsen, Tingleff, Methods for Non-Linear
// Least Squares Problems, 2004), and so is the treatment of losses: all of ours are concave, where Ceres
// re-weights by rho' and leaves rho'' out. The pattern is analysed once for the edges that count.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "backend/solver/block_equations.h"
#include "backend/solver/graph_solver.h"
#include "core/least_squares.h"
#include "core/stopwatch.h"

namespace tutti::internal {

/// Levenberg-Marquardt on the active set that the equations were analysed for.
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
    out_.converged = equations_.active().nodes.empty();
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

/// The whole graph.
template <int N>
class BlockSolver final : public GraphSolver<N> {
 public:
  SolveSummary Solve(WeightedGraph<N>& graph, const SolveLimits& limits) override {
    std::vector<bool> counts = graph.Active();
    if (!analysed_ || counts != counts_) Analyse(graph, std::move(counts));
    return LevenbergMarquardt<N>(graph, equations_, limits).Minimise();
  }

 private:
  void Analyse(const WeightedGraph<N>& graph, std::vector<bool> counts) {
    ActiveSet active;
    for (std::size_t k = 0; k < graph.structure->constant.size(); ++k) {
      if (!graph.structure->constant[k]) active.nodes.push_back(k);
    }
    for (std::size_t e = 0; e < counts.size(); ++e) {
      if (counts[e]) active.edges.push_back(e);
    }
    equations_.Analyse(graph, std::move(active));
    counts_ = std::move(counts);
    analysed_ = true;
  }

  bool analysed_ = false;
  std::vector<bool> counts_;  // edges of the analysed pattern
  BlockEquations<N> equations_;
};

}  // namespace tutti::internal
