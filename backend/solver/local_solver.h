// Levenberg-Marquardt on the part of a graph that a change disturbs. Private to the back end.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "backend/graph/neighbourhood.h"
#include "backend/solver/block_equations.h"
#include "backend/solver/block_solver.h"
#include "backend/solver/graph_solver.h"

namespace tutti::internal {

/// Nodes around what is not settled (StepInSigmas) are solved for, with the border held; where the border is
/// then not settled, the part grows.
template <int N>
class LocalSolver {
 public:
  /// `limits` say what settled is. Beyond `whole_fraction` of the nodes all are solved for.
  /// `equations` are a place to work in, kept from call to call since they are large.
  LocalSolver(WeightedGraph<N>& graph, BlockEquations<N>& equations, const SolveLimits& limits,
              double whole_fraction)
      : graph_(graph),
        equations_(equations),
        limits_(limits),
        around_(*graph.structure),
        inside_(graph.structure->constant.size()) {
    const auto& constant = graph.structure->constant;
    free_ = static_cast<std::size_t>(std::count(constant.begin(), constant.end(), false));
    largest_part_ = whole_fraction * static_cast<double>(free_);
  }

  /// Settles what is not settled of the touched nodes, and what that disturbs. `is_new`: edges that were not
  /// there before; the cycle that such an edge closes is part of the first guess.
  SolveSummary Settle(const std::vector<std::size_t>& touched, const std::vector<bool>& is_new) {
    std::vector<std::size_t> seeds = Unsettled(touched);
    SolveSummary out;
    out.usable = true;
    if (seeds.empty()) return out;
    AddCycles(seeds, is_new);
    bool converged = false;
    for (int hops = kFirstHops; !seeds.empty() || !converged; seeds = Unsettled(Border())) {
      if (!seeds.empty()) Grow(seeds, hops);
      hops *= seeds.empty() ? 1 : 3;
      const bool rough = !seeds.empty() && !Whole();  // the part may have to grow
      const SolveSummary round = Solve(rough ? kRoughIterations : limits_.max_iterations);
      out.iterations += round.iterations;
      out.usable = round.usable;
      out.message = round.message;
      converged = !rough || round.converged;  // or at a limit
      if (!out.usable) break;
    }
    return out;
  }

  /// Nodes that were solved for, in the order in which they came in.
  const std::vector<std::size_t>& Part() const { return part_; }
  bool Whole() const { return part_.size() == free_; }
  /// Edges with at least one end in the part.
  const std::vector<std::size_t>& Edges() const { return edges_; }

 private:
  static constexpr int kFirstHops = 4;
  static constexpr int kRoughIterations = 1;  // while the part still grows

  void AddCycles(std::vector<std::size_t>& seeds, const std::vector<bool>& is_new) {
    const std::size_t count = seeds.size();
    std::vector<bool> unsettled(inside_.size());
    for (const std::size_t node : seeds) unsettled[node] = true;
    for (std::size_t k = 0; k < count; ++k) {
      around_.ForEdges(seeds[k], [&](std::size_t e) {
        const EdgeEnds& ends = graph_.structure->ends[e];
        if (!is_new[e] || ends.from != seeds[k] || !graph_.is_loop[e]) return;
        const std::vector<std::size_t> path = around_.Path(ends.from, ends.to, is_new);
        seeds.insert(seeds.end(), path.begin(), path.end());
      });
    }
  }

  void Grow(const std::vector<std::size_t>& seeds, int hops) {
    around_.Grow(seeds, hops, part_, inside_);
    if (static_cast<double>(part_.size()) <= largest_part_) return;
    for (std::size_t k = 0; k < inside_.size(); ++k) {
      if (inside_[k] || graph_.structure->constant[k]) continue;
      inside_[k] = true;
      part_.push_back(k);
    }
  }

  SolveSummary Solve(int max_iterations) {
    if (analysed_ != part_.size()) {
      analysed_ = part_.size();
      std::sort(part_.begin(), part_.end());
      edges_.clear();
      for (const std::size_t node : part_) {
        around_.ForEdges(node, [&](std::size_t e) {
          // An edge between two nodes of the part comes with the earlier one.
          const std::size_t other = around_.Other(e, node);
          if (graph_.weights[e] > 0 && (!inside_[other] || node < other)) edges_.push_back(e);
        });
      }
      equations_.Analyse(graph_, {part_, edges_});
    }
    SolveLimits limits = limits_;
    limits.max_iterations = max_iterations;
    return LevenbergMarquardt<N>(graph_, equations_, limits).Minimise();
  }

  /// Nodes next to the part that could move.
  std::vector<std::size_t> Border() const {
    std::vector<std::size_t> border;
    for (const std::size_t e : edges_) {
      const EdgeEnds& ends = graph_.structure->ends[e];
      for (const std::size_t node : {ends.from, ends.to}) {
        if (!inside_[node] && !graph_.structure->constant[node]) border.push_back(node);
      }
    }
    std::sort(border.begin(), border.end());
    border.erase(std::unique(border.begin(), border.end()), border.end());
    return border;
  }

  std::vector<std::size_t> Unsettled(const std::vector<std::size_t>& nodes) const {
    std::vector<std::size_t> out;
    for (const std::size_t node : nodes) {
      if (!graph_.structure->constant[node] && StepInSigmas(node) > limits_.settled_sigmas)
        out.push_back(node);
    }
    return out;
  }

  double StepInSigmas(std::size_t node) const {
    using Block = Eigen::Matrix<double, N, N>;
    Block H = Block::Zero(), J[2];
    Eigen::Matrix<double, N, 1> g = Eigen::Matrix<double, N, 1>::Zero(), r;
    around_.ForEdges(node, [&](std::size_t e) {
      if (graph_.weights[e] == 0) return;
      const int end = graph_.structure->ends[e].from == node ? 0 : 1;
      graph_.Whitened(e, r, end == 0 ? &J[0] : nullptr, end == 1 ? &J[1] : nullptr);
      double pull = 1;
      graph_.Loss(e, r.squaredNorm(), pull);
      H.noalias() += pull * J[end].transpose() * J[end];
      g.noalias() += pull * J[end].transpose() * r;
    });
    return internal::StepInSigmas<N>(H, g);
  }

  WeightedGraph<N>& graph_;
  BlockEquations<N>& equations_;
  const SolveLimits& limits_;
  Neighbourhood around_;
  double largest_part_ = 0;
  std::size_t free_ = 0;      // nodes that may move
  std::vector<bool> inside_;  // of the part, by node
  std::vector<std::size_t> part_, edges_;
  std::size_t analysed_ = 0;  // nodes of the part that the equations are for
};

}  // namespace tutti::internal
