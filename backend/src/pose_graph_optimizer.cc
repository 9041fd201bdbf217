#include "tutti/backend/pose_graph_optimizer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "graph_initialization.h"
#include "graph_problem.h"
#include "graph_structure.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::GraphProblem;
using internal::GraphStructure;

class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// One optimisation; the class only keeps what its steps share.
template <int N>
class Run {
 public:
  Run(PoseGraph& graph, const GraphStructure& structure, const PoseGraphOptions& options,
      PoseGraphReport& report)
      : graph_(graph),
        structure_(structure),
        options_(options),
        report_(report),
        problem_(graph, structure, options) {}

  bool Initialize() {
    std::vector<std::pair<GraphInit, std::vector<Similarity>>> candidates;
    const bool every = options_.init == GraphInit::kAuto;
    std::string missing, reason;
    if (every || options_.init == GraphInit::kFile) {
      std::vector<Similarity> poses;
      for (std::size_t k = 0; k < graph_.nodes().size(); ++k) {
        const PoseGraphNode& node = graph_.nodes()[k];
        if (!node.has_estimate && missing.empty()) missing = std::to_string(node.id);
        poses.push_back(node.pose);
      }
      if (missing.empty()) candidates.emplace_back(GraphInit::kFile, std::move(poses));
    }
    if (every || options_.init == GraphInit::kOdometry) {
      candidates.emplace_back(GraphInit::kOdometry, internal::OdometryInitialization(graph_, structure_));
    }
    if (every || options_.init == GraphInit::kChordal) {
      std::vector<Similarity> poses = internal::ChordalInitialization(graph_, structure_, reason);
      if (!poses.empty()) candidates.emplace_back(GraphInit::kChordal, std::move(poses));
    }
    if (candidates.empty()) {
      report_.reason =
          options_.init == GraphInit::kFile
              ? "node " + missing + " has no pose; initialise from the edges (auto, odometry or chordal)"
              : "the chordal initialisation failed: " + reason;
      return false;
    }
    TakeBest(candidates);
    return true;
  }

  bool Solve() {
    report_.initial_costs = EvaluateCosts(Copy());
    report_.initial_objective = problem_.Objective();
    if (!std::isfinite(report_.initial_objective)) {
      report_.reason = "the cost at the start is not finite; the poses or measurements are too large";
      return false;
    }
    const bool gnc = options_.robust == RobustLoss::kGnc && HasLoops();
    const bool usable = gnc ? SolveGnc() : SolveOnce(options_.max_iterations);
    report_.objective = problem_.Objective();
    if (!usable || !std::isfinite(report_.objective)) {
      if (report_.reason.empty()) report_.reason = "the solver found no usable step";
      return false;
    }
    return true;
  }

  /// Poses into the graph, edge outcomes and costs into the report.
  void Finish() {
    WritePoses(graph_);
    report_.costs = EvaluateCosts(graph_);
    report_.edges.resize(graph_.edges().size());
    for (std::size_t e = 0; e < report_.edges.size(); ++e) {
      EdgeOutcome& out = report_.edges[e];
      out.chi2 = problem_.EdgeChi2(e);
      if (!problem_.IsLoop(e)) continue;
      out.weight = options_.robust == RobustLoss::kGnc
                       ? problem_.weight(e)
                       : internal::RobustWeight(options_.robust, out.chi2, problem_.threshold());
      out.down_weighted = out.weight < 0.5;
      if (out.down_weighted) ++report_.down_weighted;
    }
  }

 private:
  void TakeBest(std::vector<std::pair<GraphInit, std::vector<Similarity>>>& candidates) {
    std::size_t best = 0;
    double lowest = 0;
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      problem_.SetPoses(candidates[k].second);
      const double cost = problem_.Objective();
      if (k == 0 || cost < lowest || !std::isfinite(lowest)) {
        best = k;
        lowest = cost;
      }
    }
    report_.init = candidates[best].first;
    problem_.SetPoses(candidates[best].second);
  }

  bool HasLoops() const {
    return std::any_of(graph_.edges().begin(), graph_.edges().end(),
                       [](const PoseGraphEdge& edge) { return edge.kind == EdgeKind::kLoop; });
  }

  bool SolveOnce(int max_iterations) {
    const double left = options_.max_time_s > 0 ? std::max(1e-3, options_.max_time_s - watch_.Seconds()) : 0;
    const ceres::Solver::Summary summary = problem_.Solve(max_iterations, left);
    report_.iterations += summary.num_successful_steps + summary.num_unsuccessful_steps;
    if (!summary.IsSolutionUsable()) {
      report_.termination = "failed";
      report_.reason = "Ceres: " + summary.message;
      return false;
    }
    const bool timed_out = options_.max_time_s > 0 && watch_.Seconds() >= options_.max_time_s;
    report_.termination = summary.termination_type == ceres::CONVERGENCE ? "converged"
                          : timed_out                                    ? "time limit"
                                                                         : "iteration limit";
    return true;
  }

  double LargestLoopChi2() const {
    double largest = 0;
    for (std::size_t e = 0; e < graph_.edges().size(); ++e) {
      if (problem_.IsLoop(e)) largest = std::max(largest, problem_.EdgeChi2(e));
    }
    return largest;
  }

  /// Yang et al., RA-L 2020, eq. (14) and remark 5: truncated least squares by graduated non-convexity.
  bool SolveGnc() {
    constexpr int kIterationsPerRound =
        3;  // the surrogate moves on before it has converged; the last round converges
    const double c2 = problem_.threshold();
    if (!SolveOnce(options_.max_iterations)) return false;
    const double largest = LargestLoopChi2();
    if (largest <= c2) return true;  // nothing to doubt: plain least squares is the answer
    double mu = c2 / (2.0 * largest - c2);
    for (int round = 0; round < options_.gnc_max_rounds; ++round, mu *= options_.gnc_step) {
      ++report_.gnc_rounds;
      if (UpdateGncWeights(mu, c2)) break;
      if (report_.iterations >= options_.max_iterations) break;
      if (!SolveOnce(kIterationsPerRound)) return false;
    }
    for (std::size_t e = 0; e < graph_.edges().size(); ++e) {
      if (problem_.IsLoop(e)) problem_.SetWeight(e, problem_.weight(e) < 0.5 ? 0.0 : 1.0);
    }
    return SolveOnce(options_.max_iterations);
  }

  /// True if every weight is 0 or 1.
  bool UpdateGncWeights(double mu, double c2) {
    bool binary = true;
    for (std::size_t e = 0; e < graph_.edges().size(); ++e) {
      if (!problem_.IsLoop(e)) continue;
      const double s = problem_.EdgeChi2(e);
      double weight = std::sqrt(c2 * mu * (mu + 1.0) / std::max(s, 1e-300)) - mu;
      if (s >= (mu + 1.0) / mu * c2) weight = 0.0;
      if (s <= mu / (mu + 1.0) * c2) weight = 1.0;
      weight = std::clamp(weight, 0.0, 1.0);
      if (weight > 1e-4 && weight < 1.0 - 1e-4) binary = false;
      problem_.SetWeight(e, weight);
    }
    return binary;
  }

  void WritePoses(PoseGraph& graph) const {
    const std::vector<Similarity> poses = problem_.Poses();
    for (std::size_t k = 0; k < poses.size(); ++k) {
      if (!structure_.constant[k] || !graph.nodes()[k].has_estimate)
        graph.SetPose(graph.nodes()[k].id, poses[k]);
    }
  }
  PoseGraph Copy() const {
    PoseGraph copy = graph_;
    WritePoses(copy);
    return copy;
  }

  PoseGraph& graph_;
  const GraphStructure& structure_;
  const PoseGraphOptions& options_;
  PoseGraphReport& report_;
  GraphProblem<N> problem_;
  Stopwatch watch_;
};

template <int N>
void OptimizeAs(PoseGraph& graph, const GraphStructure& structure, const PoseGraphOptions& options,
                PoseGraphReport& report) {
  const Stopwatch watch;
  Run<N> run(graph, structure, options, report);
  const bool initialized = run.Initialize();
  report.init_time_s = watch.Seconds();
  if (initialized && run.Solve()) {
    run.Finish();
    report.success = true;
  } else {
    report.termination = "failed";
    report.costs = EvaluateCosts(graph);
  }
}

}  // namespace

std::string PoseGraphOptions::Validate() const {
  if (!(robust_chi2 >= 0) || !std::isfinite(robust_chi2))
    return "pose graph: robust_chi2 must be 0 (automatic) or positive";
  if (max_iterations < 1) return "pose graph: max_iterations must be at least 1";
  if (!(function_tolerance > 0 && function_tolerance < 1))
    return "pose graph: function_tolerance must be in (0, 1)";
  if (!(gnc_step > 1) || !std::isfinite(gnc_step)) return "pose graph: gnc_step must be greater than 1";
  if (gnc_max_rounds < 1) return "pose graph: gnc_max_rounds must be at least 1";
  if (!(max_time_s >= 0) || !std::isfinite(max_time_s))
    return "pose graph: max_time_s must be 0 (no limit) or positive";
  return {};
}

PoseGraphOptimizer::PoseGraphOptimizer(const PoseGraphOptions& options) : options_(options) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
}

PoseGraphReport PoseGraphOptimizer::Optimize(PoseGraph& graph) const {
  const Stopwatch watch;
  PoseGraphReport report;
  const GraphStructure structure = internal::AnalyseGraph(graph);
  report.components = structure.components;
  if (graph.edges().empty()) {
    report.success = true;
    report.termination = "nothing to do";
  } else {
    switch (graph.kind()) {
      case GraphKind::kSE2:
        OptimizeAs<3>(graph, structure, options_, report);
        break;
      case GraphKind::kSE3:
        OptimizeAs<6>(graph, structure, options_, report);
        break;
      case GraphKind::kSim3:
        OptimizeAs<7>(graph, structure, options_, report);
        break;
    }
  }
  report.time_s = watch.Seconds();
  return report;
}

}  // namespace tutti
