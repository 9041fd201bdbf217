// Ceres on a pose graph.
#include <ceres/ceres.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "backend/graph/manifold.h"
#include "backend/solver/weighted_graph.h"

namespace tutti::internal {
namespace {

/// Whitened error of one edge, times the square root of a weight that may change between solves.
template <int N>
class EdgeCost final : public ceres::SizedCostFunction<N, BlockSize<N>(), BlockSize<N>()> {
 public:
  /// Both outlive this object and stay where they are.
  EdgeCost(const EdgeError<N>& edge, const double& weight) : edge_(edge), weight_(weight) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    using Lifted = Eigen::Matrix<double, N, BlockSize<N>(), Eigen::RowMajor>;
    Eigen::Matrix<double, N, 1> residual;
    Eigen::Matrix<double, N, N> J[2];
    const bool want[2] = {jacobians != nullptr && jacobians[0] != nullptr,
                          jacobians != nullptr && jacobians[1] != nullptr};
    edge_.EvaluateWhitened(parameters[0], parameters[1], residual, want[0] ? &J[0] : nullptr,
                           want[1] ? &J[1] : nullptr);
    const double root = std::sqrt(weight_);
    Eigen::Map<Eigen::Matrix<double, N, 1>>{residuals} = root * residual;
    for (int k = 0; k < 2; ++k) {
      if (!want[k]) continue;
      Eigen::Map<Lifted> out(jacobians[k]);
      if constexpr (N != 3) out.template rightCols<1>().setZero();
      out.template leftCols<N>() = root * J[k];
    }
    return true;
  }

 private:
  const EdgeError<N>& edge_;
  const double& weight_;
};

/// Ends a solution that nobody wants any more.
class StopCallback final : public ceres::IterationCallback {
 public:
  /// `stop` outlives this object.
  explicit StopCallback(const StopRequest& stop) : stop_(stop) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& /*summary*/) override {
    stopped_ = stop_();
    return stopped_ ? ceres::SOLVER_ABORT : ceres::SOLVER_CONTINUE;
  }
  bool stopped() const { return stopped_; }

 private:
  const StopRequest& stop_;
  bool stopped_ = false;
};

template <int N>
class CeresSolver final : public GraphSolver<N> {
 public:
  CeresSolver() {
    if constexpr (N != 3) manifold_ = std::make_unique<NodeManifold<N - 3>>();
  }

  SolveSummary Solve(WeightedGraph<N>& graph, const SolveLimits& limits) override {
    if (!problem_ || active_ != graph.Active()) Build(graph);
    loss_.Reset(graph.loss(), ceres::DO_NOT_TAKE_OWNERSHIP);
    ceres::Solver::Summary summary;
    ceres::Solver::Options options = Options(limits);
    StopCallback stop_callback(limits.stop);
    if (limits.stop) options.callbacks.push_back(&stop_callback);
    ceres::Solve(options, &*problem_, &summary);
    if (stop_callback.stopped()) throw Stopped();
    SolveSummary out;
    out.usable = summary.IsSolutionUsable();
    out.converged = summary.termination_type == ceres::CONVERGENCE;
    // -1 each where nothing is free to move.
    out.iterations = std::max(0, summary.num_successful_steps + summary.num_unsuccessful_steps);
    if (!summary.iterations.empty()) out.trust_region = summary.iterations.back().trust_region_radius;
    out.message = "Ceres: " + summary.message;
    return out;
  }

 private:
  static ceres::Solver::Options Options(const SolveLimits& limits) {
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    if (ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::SUITE_SPARSE)) {
      options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
    } else {
      options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    }
    options.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
    options.initial_trust_region_radius = limits.trust_region;
    options.max_num_iterations = limits.max_iterations;
    if (limits.max_time_s > 0) options.max_solver_time_in_seconds = limits.max_time_s;
    options.function_tolerance = limits.function_tolerance;
    options.gradient_tolerance = 0;
    options.parameter_tolerance = 1e-14;
    options.num_threads = 1;  // more threads change the last bits
    options.logging_type = ceres::SILENT;
    return options;
  }

  static ceres::Problem::Options ProblemOptions() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    DoNotOwnManifolds(options);
    options.disable_all_safety_checks = true;
    return options;
  }

  /// The edges that count; again whenever others do.
  void Build(WeightedGraph<N>& graph) {
    problem_.emplace(ProblemOptions());
    active_ = graph.Active();
    for (std::size_t e = costs_.size(); e < active_.size(); ++e)
      costs_.emplace_back(graph.Edge(e), graph.weights()[e]);
    const GraphStructure& structure = graph.structure();
    for (std::size_t k = 0; k < structure.constant.size(); ++k) {
      AddBlock(*problem_, graph.Block(k), BlockSize<N>(), manifold_.get());
      if (structure.constant[k]) problem_->SetParameterBlockConstant(graph.Block(k));
    }
    graph.terms().AddTo(*problem_, graph.blocks());
    for (std::size_t e = 0; e < active_.size(); ++e) {
      if (!active_[e]) continue;
      double *from = graph.Block(structure.ends[e].from), *to = graph.Block(structure.ends[e].to);
      problem_->AddResidualBlock(&costs_[e], graph.IsLoop(e) ? &loss_ : nullptr, from, to);
    }
  }

  std::unique_ptr<ManifoldBase> manifold_;
  ceres::LossFunctionWrapper loss_{nullptr, ceres::DO_NOT_TAKE_OWNERSHIP};
  std::deque<EdgeCost<N>> costs_;          // parallel to edges; a deque: cost functions can't be moved
  std::vector<bool> active_;               // edges of the problem
  std::optional<ceres::Problem> problem_;  // last: refers to the others
};

}  // namespace

template <int N>
std::unique_ptr<GraphSolver<N>> MakeCeresSolver() {
  return std::make_unique<CeresSolver<N>>();
}

template std::unique_ptr<GraphSolver<3>> MakeCeresSolver<3>();
template std::unique_ptr<GraphSolver<6>> MakeCeresSolver<6>();
template std::unique_ptr<GraphSolver<7>> MakeCeresSolver<7>();

}  // namespace tutti::internal
