// A pose graph as a Ceres problem: built once, solved as often as GNC needs it. Private to the back end.
#pragma once

#include <ceres/ceres.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "edge_error.h"
#include "graph_structure.h"
#include "linearized_edge.h"
#include "manifold.h"
#include "robust_loss.h"
#include "switched_edge.h"

namespace tutti::internal {

/// Whitened error of one edge, times the square root of a weight that GNC changes between solves.
template <int N>
class EdgeCost final : public ceres::SizedCostFunction<N, BlockSize<N>(), BlockSize<N>()> {
 public:
  explicit EdgeCost(const EdgeConstants<N>& constants) : constants_(constants) {}

  const EdgeConstants<N>& constants() const { return constants_; }
  void SetWeight(double weight) { sqrt_weight_ = std::sqrt(weight); }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    using Matrix = Eigen::Matrix<double, N, N>;
    using Lifted = Eigen::Matrix<double, N, BlockSize<N>(), Eigen::RowMajor>;
    Eigen::Matrix<double, N, 1> error;
    Matrix J[2];
    const bool want[2] = {jacobians != nullptr && jacobians[0] != nullptr,
                          jacobians != nullptr && jacobians[1] != nullptr};
    EdgeError<N>(constants_, parameters[0], parameters[1], error, want[0] ? &J[0] : nullptr,
                 want[1] ? &J[1] : nullptr);
    const Matrix S = sqrt_weight_ * constants_.sqrt_information;
    Eigen::Map<Eigen::Matrix<double, N, 1>>{residuals}.noalias() = S * error;
    for (int k = 0; k < 2; ++k) {
      if (!want[k]) continue;
      Eigen::Map<Lifted> out(jacobians[k]);
      if constexpr (N != 3) out.template rightCols<1>().setZero();
      out.template leftCols<N>().noalias() = S * J[k];
    }
    return true;
  }

 private:
  EdgeConstants<N> constants_;
  double sqrt_weight_ = 1.0;
};

template <int N>
class GraphProblem {
 public:
  GraphProblem(const PoseGraph& graph, const GraphStructure& structure, const PoseGraphOptions& options)
      : graph_(graph),
        structure_(structure),
        options_(options),
        threshold_(options.robust_chi2 > 0 ? options.robust_chi2 : ChiSquare99(N)),
        switch_prior_(threshold_) {
    blocks_.resize(graph.nodes().size() * kBlock);
    weights_.assign(graph.edges().size(), 1.0);
    excluded_.assign(graph.edges().size(), false);
    for (const PoseGraphEdge& edge : graph.edges())
      costs_.emplace_back(MakeEdgeConstants<N>(edge, options.objective));
    if constexpr (N != 3) manifold_ = std::make_unique<NodeManifold<N - 3>>();
  }

  /// Chi-square beyond which a loop is doubted.
  double threshold() const { return threshold_; }
  void SetThreshold(double threshold) {
    threshold_ = threshold;
    switch_prior_.SetThreshold(threshold);
  }

  void SetPoses(const std::vector<Similarity>& poses) {
    for (std::size_t k = 0; k < poses.size(); ++k) PoseToBlock<N>(poses[k], Block(k));
  }
  std::vector<Similarity> Poses() const {
    std::vector<Similarity> poses;
    for (std::size_t k = 0; k < structure_.constant.size(); ++k)
      poses.push_back(BlockToPose<N>(&blocks_[k * kBlock]));
    return poses;
  }

  /// e^T Omega e of one edge, weight not applied.
  double EdgeChi2(std::size_t e) const {
    const EdgeEnds& ends = structure_.ends[e];
    const EdgeConstants<N>& c = costs_[e].constants();
    Eigen::Matrix<double, N, 1> error;
    EdgeError<N>(c, &blocks_[ends.from * kBlock], &blocks_[ends.to * kBlock], error, nullptr, nullptr);
    return (c.sqrt_information * error).squaredNorm();
  }
  LinearizedEdge<N> Linearized(std::size_t e) const {
    const EdgeEnds& ends = structure_.ends[e];
    return Linearize<N>(costs_[e].constants(), &blocks_[ends.from * kBlock], &blocks_[ends.to * kBlock]);
  }
  const GraphStructure& structure() const { return structure_; }
  bool IsLoop(std::size_t e) const { return graph_.edges()[e].kind == EdgeKind::kLoop; }

  /// What the options ask to minimise (no 1/2), at the present poses.
  double Objective() const {
    double sum = 0;
    for (std::size_t e = 0; e < costs_.size(); ++e) {
      sum += !IsLoop(e)     ? EdgeChi2(e)
             : excluded_[e] ? 0.0
                            : RobustCost(options_.robust, EdgeChi2(e), threshold_);
    }
    return sum;
  }

  /// The loss on loop edges from now on; nullptr: least squares.
  void SetLoss(ceres::LossFunction* owned) { loss_.Reset(owned, ceres::TAKE_OWNERSHIP); }

  double weight(std::size_t e) const { return weights_[e]; }
  const std::vector<double>& weights() const { return weights_; }
  /// Edges of weight 0 leave the system of equations, and with them their fill-in.
  void SetWeight(std::size_t e, double weight) {
    if ((weight == 0) != (weights_[e] == 0)) ceres_.reset();
    weights_[e] = weight;
    costs_[e].SetWeight(weight);
  }
  /// The edge is out for good: weight 0, no part of the objective.
  void Exclude(std::size_t e) {
    excluded_[e] = true;
    SetWeight(e, 0);
  }
  bool IsExcluded(std::size_t e) const { return excluded_[e]; }
  /// A loop that still has a say.
  bool IsOpen(std::size_t e) const { return IsLoop(e) && !excluded_[e]; }

  /// From now on each open loop has a switch (switchable constraints), which starts at 1.
  void AddSwitches() {
    switches_.assign(costs_.size(), 1.0);
    switched_.clear();
    for (const EdgeCost<N>& cost : costs_) switched_.emplace_back(cost);
    ceres_.reset();
  }

  /// The next solution goes on with the trust region that the last one ended with, instead of a wide one. For
  /// rounds of few iterations, which would spend them all on narrowing it.
  void KeepTrustRegion() { trust_region_ = std::min(last_trust_region_, kInitialTrustRegion); }

  ceres::Solver::Summary Solve(int max_iterations, double max_time_s) {
    if (!ceres_) BuildCeresProblem();
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
    if (ceres::IsSparseLinearAlgebraLibraryTypeAvailable(ceres::SUITE_SPARSE)) {
      options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
    } else {
      options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
    }
    options.trust_region_strategy_type = ceres::LEVENBERG_MARQUARDT;
    options.initial_trust_region_radius = trust_region_;
    options.max_num_iterations = max_iterations;
    if (max_time_s > 0) options.max_solver_time_in_seconds = max_time_s;
    options.function_tolerance = options_.function_tolerance;
    options.gradient_tolerance = 0;
    options.parameter_tolerance = 1e-14;
    options.num_threads = 1;  // more threads change the last bits
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &*ceres_, &summary);
    last_trust_region_ =
        summary.iterations.empty() ? kInitialTrustRegion : summary.iterations.back().trust_region_radius;
    trust_region_ = kInitialTrustRegion;
    return summary;
  }

 private:
  static constexpr std::size_t kBlock = static_cast<std::size_t>(BlockSize<N>());
  /// Pose graphs are close to quadratic once initialised: start near Gauss-Newton, let the region shrink if
  /// that fails.
  static constexpr double kInitialTrustRegion = 1e8;

  static ceres::Problem::Options CeresOptions() {
    ceres::Problem::Options options;
    options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    DoNotOwnManifolds(options);
    options.disable_all_safety_checks = true;
    return options;
  }

  double* Block(std::size_t k) { return &blocks_[k * kBlock]; }

  void BuildCeresProblem() {
    ceres_.emplace(CeresOptions());
    for (std::size_t k = 0; k < structure_.constant.size(); ++k) {
      AddBlock(*ceres_, Block(k), BlockSize<N>(), manifold_.get());
      if (structure_.constant[k]) ceres_->SetParameterBlockConstant(Block(k));
    }
    for (std::size_t e = 0; e < costs_.size(); ++e) {
      if (weights_[e] == 0) continue;
      const EdgeEnds& ends = structure_.ends[e];
      if (!switches_.empty() && IsLoop(e)) {
        ceres_->AddResidualBlock(&switched_[e], nullptr, Block(ends.from), Block(ends.to), &switches_[e]);
        ceres_->AddResidualBlock(&switch_prior_, nullptr, &switches_[e]);
      } else {
        ceres_->AddResidualBlock(&costs_[e], IsLoop(e) ? &loss_ : nullptr, Block(ends.from), Block(ends.to));
      }
    }
  }

  const PoseGraph& graph_;
  const GraphStructure& structure_;
  const PoseGraphOptions& options_;
  double threshold_;
  double trust_region_ = kInitialTrustRegion, last_trust_region_ = kInitialTrustRegion;
  std::vector<double> blocks_;
  std::vector<double> weights_;
  std::deque<EdgeCost<N>> costs_;  // a deque: cost functions can't be moved
  std::unique_ptr<ManifoldBase> manifold_;
  ceres::LossFunctionWrapper loss_{nullptr, ceres::TAKE_OWNERSHIP};
  std::vector<bool> excluded_;                // parallel to edges
  std::vector<double> switches_;              // parallel to edges; empty: none
  std::deque<SwitchedEdgeCost<N>> switched_;  // the same
  SwitchPrior switch_prior_;
  std::optional<ceres::Problem> ceres_;  // last: refers to the others; built when it is needed
};

}  // namespace tutti::internal
