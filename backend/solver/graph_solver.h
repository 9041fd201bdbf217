// The weighted least-squares problem of a pose graph, and the interface of who solves it. Private to the back
// end.
#pragma once

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "backend/graph/edge_error.h"
#include "backend/graph/graph_structure.h"
#include "backend/solver/measurement_terms.h"
#include "backend/solver/stop.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// 1/2 sum rho(w e^T Omega e) over the edges, rho on loops only, as a function of the nodes that are not
/// constant. Edges of weight 0 are no part of the system of equations, and neither is their fill-in.
template <int N>
struct WeightedGraph {
  static constexpr std::size_t kBlock = static_cast<std::size_t>(BlockSize<N>());

  const GraphStructure* structure = nullptr;   ///< ends of the edges, constant nodes
  std::vector<EdgeConstants<N>> constants;     ///< parallel to edges
  std::vector<double> weights;                 ///< the same, >= 0
  std::vector<bool> is_loop;                   ///< the same: the loss acts on these
  std::unique_ptr<ceres::LossFunction> loss;   ///< nullptr: least squares
  std::vector<double> blocks;                  ///< the nodes, kBlock numbers each
  std::unique_ptr<MeasurementTerms<N>> terms;  ///< landmarks and priors, always of weight 1; Ceres knows them

  const double* Block(std::size_t node) const { return &blocks[node * kBlock]; }
  double* Block(std::size_t node) { return &blocks[node * kBlock]; }

  void Whitened(std::size_t e, Eigen::Matrix<double, N, 1>& residual,
                Eigen::Matrix<double, N, N>* jacobian_i = nullptr,
                Eigen::Matrix<double, N, N>* jacobian_j = nullptr) const {
    const EdgeEnds& ends = structure->ends[e];
    WhitenedError<N>(constants[e], Block(ends.from), Block(ends.to), residual, jacobian_i, jacobian_j);
  }
  /// e^T Omega e of one edge, weight not applied.
  double Chi2(std::size_t e) const {
    Eigen::Matrix<double, N, 1> residual;
    Whitened(e, residual);
    return residual.squaredNorm();
  }
  /// rho of an edge from its chi-square; `pull` is what multiplies its normal equations.
  double Loss(std::size_t e, double chi2, double& pull) const {
    pull = weights[e];
    if (loss == nullptr || !is_loop[e]) return pull * chi2;
    double rho[3];
    loss->Evaluate(pull * chi2, rho);
    pull *= rho[1];
    return rho[0];
  }
  /// The edges that count.
  std::vector<bool> Active() const {
    std::vector<bool> active(weights.size());
    for (std::size_t e = 0; e < active.size(); ++e) active[e] = weights[e] > 0;
    return active;
  }
};

/// Pose graphs are close to quadratic once initialised: start near Gauss-Newton, let the region shrink if
/// that fails.
constexpr double kInitialTrustRegion = 1e8;

struct SolveLimits {
  int max_iterations = 200;
  double max_time_s = 0;  ///< 0: no limit
  double function_tolerance = 1e-9;
  double trust_region = kInitialTrustRegion;  ///< radius to begin with, in Ceres' sense [1]
  StopRequest stop;                           ///< asked before each iteration; Stopped is thrown then
};

/// How a solve ended.
struct SolveSummary {
  bool usable = false;  ///< the poses are no worse than before
  bool converged = false;
  int iterations = 0;                         ///< rejected steps included
  double trust_region = kInitialTrustRegion;  ///< radius at the end
  std::string message;                        ///< why not usable
};

/// Moves the nodes of a graph to a local minimum. May keep what depends on the pattern alone from one call to
/// the next, hence is to be used with one graph.
template <int N>
class GraphSolver {
 public:
  virtual ~GraphSolver() = default;
  virtual SolveSummary Solve(WeightedGraph<N>& graph, const SolveLimits& limits) = 0;
};

/// The solver of that name. For N = 3, 6, 7; graph_solver.cc alone compiles them.
template <int N>
std::unique_ptr<GraphSolver<N>> MakeGraphSolver(PoseGraphSolver solver);

}  // namespace tutti::internal
