#include "tutti/backend/online_optimizer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "backend/graph/graph_memory.h"
#include "backend/robust/robust_loss.h"
#include "backend/solver/local_solver.h"
#include "core/stopwatch.h"
#include "tutti/core/error.h"

namespace tutti {

using internal::GraphChanges;
using internal::GraphStructure;
using internal::SolveSummary;
using internal::WeightedGraph;

class OnlineOptimizer::Impl {
 public:
  virtual ~Impl() = default;
  virtual OnlineReport Optimize(PoseGraph& graph) = 0;
};

namespace {

/// Everything, each time.
class EveryTime final : public OnlineOptimizer::Impl {
 public:
  explicit EveryTime(const PoseGraphOptions& options) : optimizer_(options) {}
  OnlineReport Optimize(PoseGraph& graph) override {
    PoseGraphReport report = optimizer_.Optimize(graph);
    OnlineReport out;
    out.success = report.success;
    out.reason = report.reason;
    out.whole = true;
    out.nodes = graph.nodes().size();
    out.iterations = report.iterations;
    out.edges = std::move(report.edges);
    out.time_s = report.time_s;
    return out;
  }

 private:
  PoseGraphOptimizer optimizer_;
};

/// Graphs of one kind; what changed alone.
template <int N>
class Incremental {
 public:
  Incremental(const PoseGraphOptions& options, const OnlineOptions& online)
      : options_(options),
        online_(online),
        threshold_(options.robust_chi2 > 0 ? options.robust_chi2 : internal::ChiSquare99(N)) {
    if (options.robust == RobustLoss::kHuber)
      graph_.loss = std::make_unique<ceres::HuberLoss>(std::sqrt(threshold_));
  }

  OnlineReport Optimize(PoseGraph& graph) {
    const internal::Stopwatch watch;
    OnlineReport report;
    for (const PoseGraphNode& node : graph.nodes()) {
      if (node.has_estimate) continue;
      report.reason = "node " + std::to_string(node.id) + " has no pose; online, each node needs one";
      return report;
    }
    std::vector<bool> touched(graph.nodes().size());
    const std::vector<bool> is_new = TakeOver(graph, touched);
    const internal::SolveLimits limits{options_.max_iterations, options_.max_time_s,
                                       options_.function_tolerance, online_.settled_sigmas};
    internal::LocalSolver<N> local(graph_, equations_, limits, online_.whole_fraction);
    const SolveSummary summary = local.Settle(Marked(touched), is_new);
    report.success = summary.usable;
    report.whole = !local.Part().empty() && local.Whole();
    report.nodes = local.Part().size();
    report.iterations = summary.iterations;
    if (summary.usable) {
      for (const std::size_t node : local.Part()) {
        graph.SetPose(graph.nodes()[node].id, internal::BlockToPose<N>(graph_.Block(node)));
        touched[node] = true;
      }
      memory_.RememberPoses(graph);
      Judge(touched, report);
    } else {
      report.reason = summary.message;
      memory_ = {};  // what was tried is not where the graph is
    }
    report.time_s = watch.Seconds();
    return report;
  }

 private:
  static std::vector<std::size_t> Marked(const std::vector<bool>& marks) {
    std::vector<std::size_t> out;
    for (std::size_t k = 0; k < marks.size(); ++k) {
      if (marks[k]) out.push_back(k);
    }
    return out;
  }

  /// Brings the equations' data to the graph as it is. Returns which edges are new.
  std::vector<bool> TakeOver(const PoseGraph& graph, std::vector<bool>& touched) {
    const GraphChanges changes = memory_.Update(graph);
    structure_ = internal::AnalyseGraph(graph);
    graph_.structure = &structure_;
    for (const std::size_t node : changes.touched) touched[node] = true;
    std::vector<int> held;  // ids
    graph_.blocks.resize(graph.nodes().size() * WeightedGraph<N>::kBlock);
    for (std::size_t k = 0; k < touched.size(); ++k) {
      const PoseGraphNode& node = graph.nodes()[k];
      const bool was_held = std::binary_search(held_.begin(), held_.end(), node.id);
      if (structure_.constant[k] != was_held) touched[k] = true;
      if (structure_.constant[k]) held.push_back(node.id);
      internal::PoseToBlock<N>(node.pose, graph_.Block(k));
    }
    std::sort(held.begin(), held.end());
    held_ = std::move(held);
    return TakeOverEdges(graph, changes.edge_before);
  }

  std::vector<bool> TakeOverEdges(const PoseGraph& graph, const std::vector<std::size_t>& before) {
    const std::size_t count = before.size();
    std::vector<internal::EdgeConstants<N>>& constants = graph_.constants;
    bool in_place = count >= constants.size();
    for (std::size_t e = 0; e < count && in_place; ++e)
      in_place = before[e] == e || before[e] == GraphChanges::kNew;
    if (!in_place) {
      std::vector<internal::EdgeConstants<N>> moved(count);
      std::vector<double> moved_chi2(count);
      for (std::size_t e = 0; e < count; ++e) {
        if (before[e] == GraphChanges::kNew) continue;
        moved[e] = constants[before[e]];
        moved_chi2[e] = chi2_[before[e]];
      }
      constants = std::move(moved);
      chi2_ = std::move(moved_chi2);
    }
    constants.resize(count);
    chi2_.resize(count);
    graph_.weights.assign(count, 1.0);
    graph_.is_loop.resize(count);
    std::vector<bool> is_new(count);
    for (std::size_t e = 0; e < count; ++e) {
      const PoseGraphEdge& edge = graph.edges()[e];
      graph_.is_loop[e] = edge.kind == EdgeKind::kLoop;
      is_new[e] = before[e] == GraphChanges::kNew;
      if (is_new[e]) constants[e] = internal::MakeEdgeConstants<N>(edge, options_.objective);
    }
    return is_new;
  }

  /// What became of the edges; only those of moved nodes are looked at again.
  void Judge(const std::vector<bool>& moved, OnlineReport& report) {
    report.edges.resize(chi2_.size());
    for (std::size_t e = 0; e < chi2_.size(); ++e) {
      const internal::EdgeEnds& ends = structure_.ends[e];
      if (moved[ends.from] || moved[ends.to]) chi2_[e] = graph_.Chi2(e);
      EdgeOutcome& out = report.edges[e];
      out.chi2 = chi2_[e];
      if (!graph_.is_loop[e]) continue;
      out.weight = internal::RobustWeight(options_.robust, out.chi2, threshold_);
      out.down_weighted = out.weight < 0.5;
      if (out.down_weighted) out.doubt = LoopDoubt::kLoss;
    }
  }

  PoseGraphOptions options_;
  OnlineOptions online_;
  double threshold_;
  internal::GraphMemory memory_;
  GraphStructure structure_;
  WeightedGraph<N> graph_;
  internal::BlockEquations<N> equations_;
  std::vector<double> chi2_;  // of the edges, after the last call
  std::vector<int> held_;     // ids of the nodes that did not move in the last call, ascending
};

class OfEachKind final : public OnlineOptimizer::Impl {
 public:
  OfEachKind(const PoseGraphOptions& options, const OnlineOptions& online)
      : se2_(options, online), se3_(options, online), sim3_(options, online) {}
  OnlineReport Optimize(PoseGraph& graph) override {
    switch (graph.kind()) {
      case GraphKind::kSE2:
        return se2_.Optimize(graph);
      case GraphKind::kSE3:
        return se3_.Optimize(graph);
      case GraphKind::kSim3:
        return sim3_.Optimize(graph);
    }
    return {};
  }

 private:
  Incremental<3> se2_;
  Incremental<6> se3_;
  Incremental<7> sim3_;
};

/// Everything while the graph is small, then in parts.
class OnceItIsLarge final : public OnlineOptimizer::Impl {
 public:
  OnceItIsLarge(const PoseGraphOptions& options, const OnlineOptions& online)
      : nodes_(online.parts_from_nodes), small_(options), large_(options, online) {}
  OnlineReport Optimize(PoseGraph& graph) override {
    return graph.nodes().size() < nodes_ ? small_.Optimize(graph) : large_.Optimize(graph);
  }

 private:
  std::uint64_t nodes_;
  EveryTime small_;
  OfEachKind large_;
};

bool CanBeSolvedInParts(const PoseGraphOptions& options) {
  return options.init == GraphInit::kFile &&
         (options.robust == RobustLoss::kNone || options.robust == RobustLoss::kHuber) &&
         !options.pairwise_consistency && !options.sigma_test;
}

}  // namespace

std::string OnlineOptions::Validate() const {
  if (!(settled_sigmas > 0) || !std::isfinite(settled_sigmas))
    return "online optimiser: settled_sigmas must be positive";
  if (!(whole_fraction > 0 && whole_fraction <= 1))
    return "online optimiser: whole_fraction must be in (0, 1]";
  return {};
}

OnlineOptimizer::OnlineOptimizer(const PoseGraphOptions& options, const OnlineOptions& online) {
  for (const std::string& wrong : {options.Validate(), online.Validate()}) {
    if (!wrong.empty()) throw InputError(wrong);
  }
  if (!CanBeSolvedInParts(options) || online.always_whole) {
    impl_ = std::make_unique<EveryTime>(options);
  } else if (options.solver == PoseGraphSolver::kBlock) {
    impl_ = std::make_unique<OfEachKind>(options, online);
  } else {
    impl_ = std::make_unique<OnceItIsLarge>(options, online);
  }
}

OnlineOptimizer::~OnlineOptimizer() = default;
OnlineOptimizer::OnlineOptimizer(OnlineOptimizer&&) noexcept = default;
OnlineOptimizer& OnlineOptimizer::operator=(OnlineOptimizer&&) noexcept = default;

OnlineReport OnlineOptimizer::Optimize(PoseGraph& graph) { return impl_->Optimize(graph); }

}  // namespace tutti
