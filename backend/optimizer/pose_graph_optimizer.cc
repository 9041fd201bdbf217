#include "tutti/backend/pose_graph_optimizer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "backend/graph/graph_structure.h"
#include "backend/robust/cluster_search.h"
#include "backend/robust/robust_solver.h"
#include "backend/solver/chordal_descent.h"
#include "backend/solver/graph_initialization.h"
#include "backend/solver/graph_problem.h"
#include "backend/solver/robust_loss.h"
#include "core/numbers.h"
#include "core/stopwatch.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::GraphProblem;
using internal::GraphStructure;
using internal::Stopwatch;

/// One optimisation; the class only keeps what its steps share.
class Run {
 public:
  Run(PoseGraph& graph, const GraphStructure& anchored, const PoseGraphOptions& options,
      const internal::StopRequest& stop, PoseGraphReport& report)
      : graph_(graph),
        anchored_(anchored),
        structure_(internal::HeldByPriors(anchored, graph)),
        options_(options),
        stop_(stop),
        report_(report),
        owned_problem_(internal::MakeGraphProblem(graph, structure_, options)),
        problem_(*owned_problem_),
        robust_(problem_, options, solve_once_) {
    problem_.SetStop(stop);
    if (problem_.HasMeasurements()) SolvedByCeres("the block solver knows neither landmarks nor priors");
  }

  /// The places to start from. False, with the reason in the report, if there is none.
  bool CollectStarts() {
    const bool every = options_.init == GraphInit::kAuto;
    std::string missing, reason;
    if (every || options_.init == GraphInit::kFile) {
      std::vector<Similarity> poses;
      for (const PoseGraphNode& node : graph_.nodes()) {
        if (!node.has_estimate && missing.empty()) missing = graph_.NameOf(node.id);
        poses.push_back(node.pose);
      }
      if (missing.empty()) AddStart(GraphStart::kFile, std::move(poses));
    }
    if (every || options_.init == GraphInit::kOdometry) {
      AddStart(GraphStart::kOdometry, internal::OdometryInitialization(graph_, anchored_));
    }
    if (every || options_.init == GraphInit::kChordal) {
      std::vector<Similarity> poses = internal::ChordalInitialization(graph_, anchored_, reason);
      if (!poses.empty()) AddStart(GraphStart::kChordalRelaxation, std::move(poses));
    }
    std::stable_sort(starts_.begin(), starts_.end(),
                     [](const Start& a, const Start& b) { return a.objective < b.objective; });
    if (!starts_.empty()) return true;
    report_.reason =
        !reason.empty() ? "the chordal initialisation failed: " + reason
        : !missing.empty()
            ? "node " + missing + " has no pose; initialise from the edges (auto, odometry or chordal)"
            : "the cost at the start is not finite; the poses or measurements are too large";
    return false;
  }

  /// Solves from the start of lowest cost. With a robust loss the cost counts it in: a chordal start that
  /// false loops have bent loses to the odometry.
  bool Solve() {
    starts_.resize(1);
    const bool robust =
        options_.robust != RobustLoss::kNone && !robust_.loops().empty() && !LeastSquaresSuffices();
    if (robust || !plain_.empty() ? !SolveRobustly(robust) : !SolveFromEach()) {
      if (report_.reason.empty()) report_.reason = "the solver found no usable step";
      return false;
    }
    report_.gnc_rounds = robust_.rounds();
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
      out.weight = WeightOf(e, out.chi2);
      out.down_weighted = out.weight < 0.5;
      if (out.down_weighted) ++report_.down_weighted;
    }
  }

 private:
  struct Start {
    GraphStart start;
    std::vector<Similarity> poses;
    double objective;
  };

  /// With a robust loss, or from the least-squares solution that makes it unnecessary.
  bool SolveRobustly(bool robust) {
    bool found = false;
    std::vector<Similarity> best;
    std::vector<double> best_weights;
    const Start& start = starts_.front();
    for (int attempt = 0; attempt < (robust ? robust_.Attempts() : 1); ++attempt) {
      problem_.SetPoses(plain_.empty() ? start.poses : plain_);
      if (plain_.empty() && !robust_.Solve(attempt)) continue;
      const double objective = problem_.Objective();
      if (!std::isfinite(objective) || (found && objective >= report_.objective)) continue;
      found = true;
      report_.objective = objective;
      best = problem_.Poses();
      best_weights = problem_.weights();
    }
    if (!found) return false;
    Took(start);
    problem_.SetPoses(best);
    for (std::size_t e = 0; e < best_weights.size(); ++e) problem_.SetWeight(e, best_weights[e]);
    if (robust) {
      robust_.Refine();
      if (options_.robust == RobustLoss::kGnc && !problem_.HasMeasurements()) ReconsiderClusters();
      report_.objective = problem_.Objective();
    }
    report_.starts.push_back({start.start, start.objective, report_.objective, false});
    return true;
  }

  void ReconsiderClusters() {
    const std::string termination = report_.termination, reason = report_.reason;
    if (internal::SearchClusters(problem_, options_, robust_, solve_once_)) return;
    report_.termination = termination;
    report_.reason = reason;
  }

  /// Least squares. The chordal objective has fewer valleys than the one that is asked for, so its optimum is
  /// a start, too, and the first one; the relaxation follows where its way does not lead to the same place.
  bool SolveFromEach() {
    if (starts_.front().start == GraphStart::kChordalRelaxation) AddChordalOptimum();
    std::vector<Similarity> best;
    std::string termination;
    for (const Start& start : starts_) {
      if (!best.empty() && LeadsDownhill(start.poses, best)) {
        report_.starts.push_back({start.start, start.objective, report_.objective, true});
        continue;
      }
      problem_.SetPoses(start.poses);
      if (!SolveOnce(options_.max_iterations)) continue;
      const double objective = problem_.Objective();
      report_.starts.push_back({start.start, start.objective, objective, false});
      constexpr double kSame = 1e-9;  // of the objective: the same valley
      if (!std::isfinite(objective) || (!best.empty() && objective >= (1 - kSame) * report_.objective))
        continue;
      report_.objective = objective;
      termination = report_.termination;
      best = problem_.Poses();
      Took(start);
    }
    if (best.empty()) return false;
    report_.reason.clear();
    report_.termination = termination;
    problem_.SetPoses(best);
    return true;
  }

  void Took(const Start& start) {
    report_.start = start.start;
    report_.initial_objective = start.objective;
    std::vector<Similarity> poses = start.poses;
    for (Similarity& pose : poses) pose.rotation.normalize();
    report_.initial_costs = internal::CostsAt(graph_, poses);
    report_.chordal_optimum.clear();
    if (start.start != GraphStart::kChordalOptimum) return;
    report_.chordal_optimum = start.poses;
    report_.chordal_optimum.resize(graph_.nodes().size());
  }

  /// Local minima differ by whole turns, which the edges of a loop share. Where the relaxation leaves no edge
  /// with a residual rotation of more than this, chi2 falls from it to the best known solution on the
  /// twelve graphs, published and generated, that have none. The first one where it does not has 19 degrees.
  bool RelaxationIsNearTheOptimum(const std::vector<Similarity>& poses) const {
    constexpr double kMost = 10 * internal::kRadians;
    for (std::size_t e = 0; e < graph_.edges().size(); ++e) {
      const internal::EdgeEnds& ends = structure_.ends[e];
      const Eigen::Quaterniond turned = poses[ends.from].rotation * graph_.edges()[e].measurement.rotation;
      if (!(turned.angularDistance(poses[ends.to].rotation) <= kMost)) return false;
    }
    return true;
  }

  /// Before the relaxation that it comes from. Graphs with scale have none.
  void AddChordalOptimum() {
    if (graph_.kind() == GraphKind::kSim3) return;
    if (!options_.will_certify && RelaxationIsNearTheOptimum(starts_.front().poses)) return;
    std::vector<Similarity> poses = starts_.front().poses;
    poses.resize(graph_.nodes().size());
    const internal::SolveSummary summary =
        internal::MinimiseChordal(graph_, anchored_, options_.max_iterations, TimeLeft(), poses, stop_);
    report_.iterations += summary.iterations;
    if (!summary.usable) return;
    PlaceMeasured(GraphStart::kChordalOptimum, poses);
    problem_.SetPoses(poses);
    const double objective = problem_.Objective();
    if (!std::isfinite(objective)) return;
    starts_.insert(starts_.begin(), {GraphStart::kChordalOptimum, std::move(poses), objective});
  }

  /// True if the cost falls all along the straight way from `poses` to a solution: no ridge is between them.
  bool LeadsDownhill(const std::vector<Similarity>& poses, const std::vector<Similarity>& solution) {
    constexpr int kSteps = 8;
    std::vector<Similarity> between = poses;
    double last = std::numeric_limits<double>::infinity();
    for (int step = 0; step <= kSteps; ++step) {
      const double share = static_cast<double>(step) / kSteps;
      for (std::size_t k = 0; k < between.size(); ++k) {
        between[k].rotation = poses[k].rotation.slerp(share, solution[k].rotation);
        between[k].translation = (1 - share) * poses[k].translation + share * solution[k].translation;
        between[k].scale = std::pow(poses[k].scale, 1 - share) * std::pow(solution[k].scale, share);
      }
      problem_.SetPoses(between);
      const double objective = problem_.Objective();
      if (!(objective <= last)) return false;
      last = objective;
    }
    return true;
  }

  double TimeLeft() const {
    return options_.max_time_s > 0 ? std::max(1e-3, options_.max_time_s - watch_.Seconds()) : 0;
  }

  void SolvedByCeres(const std::string& why) {
    report_.solver = PoseGraphSolver::kCeres;
    if (options_.solver != report_.solver) report_.solver_note = why;
  }

  double WeightOf(std::size_t e, double chi2) const {
    if (options_.robust == RobustLoss::kGnc) return problem_.weight(e);
    return internal::RobustWeight(options_.robust, chi2, problem_.threshold());
  }

  /// What only landmarks and priors need.
  void PlaceMeasured(GraphStart start, std::vector<Similarity>& poses) const {
    if (start != GraphStart::kFile && problem_.HasMeasurements())
      internal::AlignToPriors(graph_, anchored_, poses);
    internal::AppendLandmarks(graph_, start == GraphStart::kFile, poses);
  }

  void AddStart(GraphStart start, std::vector<Similarity> poses) {
    PlaceMeasured(start, poses);
    problem_.SetPoses(poses);
    const double objective = problem_.Objective();
    for (const Start& other : starts_) {
      if (std::abs(objective - other.objective) <= 1e-9 * objective)
        return;  // the file often is the odometry
    }
    if (std::isfinite(objective)) starts_.push_back({start, std::move(poses), objective});
  }

  bool SolveOnce(int max_iterations) {
    const internal::SolveSummary summary = problem_.Solve(max_iterations, TimeLeft());
    report_.iterations += summary.iterations;
    if (!summary.usable) {
      report_.termination = "failed";
      report_.reason = summary.message;
      return false;
    }
    const bool timed_out = options_.max_time_s > 0 && watch_.Seconds() >= options_.max_time_s;
    report_.termination = summary.converged ? "converged" : timed_out ? "time limit" : "iteration limit";
    return true;
  }

  /// The common case online: least squares brings every loop below the threshold, so no loss has anything to
  /// do. False loops show long before the iterations are through.
  bool LeastSquaresSuffices() {
    constexpr int kFew = 20;
    problem_.SetPoses(starts_.front().poses);
    if (!SolveOnce(std::min(kFew, options_.max_iterations))) return false;
    if (!(robust_.LargestChi2() <= problem_.threshold())) return false;
    if (report_.termination != "converged" && !SolveOnce(options_.max_iterations)) return false;
    plain_ = problem_.Poses();
    return true;
  }

  void WritePoses(PoseGraph& graph) const {
    const std::vector<Similarity> poses = problem_.Poses();
    const std::size_t nodes = graph.nodes().size();
    for (std::size_t k = 0; k < nodes; ++k) {
      if (!structure_.constant[k] || !graph.nodes()[k].has_estimate)
        graph.SetPose(graph.nodes()[k].id, poses[k]);
    }
    for (std::size_t k = nodes; k < poses.size(); ++k)
      graph.SetLandmark(graph.landmarks()[k - nodes].id, poses[k].translation);
  }
  PoseGraph& graph_;
  const GraphStructure& anchored_;  // an anchor in each part
  const GraphStructure structure_;  // none where priors hold it
  const PoseGraphOptions& options_;
  const internal::StopRequest& stop_;
  PoseGraphReport& report_;
  const std::unique_ptr<GraphProblem> owned_problem_;
  GraphProblem& problem_;
  const std::function<bool(int)> solve_once_ = [this](int iterations) { return SolveOnce(iterations); };
  internal::RobustSolver robust_;
  std::vector<Start> starts_;
  std::vector<Similarity> plain_;  ///< the least-squares solution, where it suffices
  Stopwatch watch_;
};

void OptimizeFromStarts(PoseGraph& graph, const GraphStructure& structure, const PoseGraphOptions& options,
                        const internal::StopRequest& stop, PoseGraphReport& report) {
  const Stopwatch watch;
  Run run(graph, structure, options, stop, report);
  const bool initialized = run.CollectStarts();
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

PoseGraphOptimizer::PoseGraphOptimizer(const PoseGraphOptions& options) : options_(options) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
}

PoseGraphReport PoseGraphOptimizer::Optimize(PoseGraph& graph, const std::function<bool()>& stop) const {
  const Stopwatch watch;
  PoseGraphReport report;
  report.solver = options_.solver;
  const GraphStructure structure = internal::AnalyseGraph(graph);
  report.components = structure.components;
  if (graph.edges().empty() && graph.measurements().empty()) {
    report.success = true;
    report.termination = "nothing to do";
  } else {
    try {
      OptimizeFromStarts(graph, structure, options_, stop, report);
    } catch (const internal::Stopped&) {
      PoseGraphReport stopped;
      stopped.solver = options_.solver;
      stopped.components = structure.components;
      stopped.termination = "stopped";
      stopped.reason = "stopped by the caller";
      stopped.costs = EvaluateCosts(graph);
      report = stopped;
    }
  }
  report.time_s = watch.Seconds();
  return report;
}

}  // namespace tutti
