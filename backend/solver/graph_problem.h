// What is to be minimised for a pose graph, with weights that robust losses change. Private to the back end.
//
// Those who decide where to start and which loops to believe know no number of coordinates and are compiled
// once; those who compute see the problem as a WeightedGraph<N> (weighted_graph.h).
#pragma once

#include <ceres/loss_function.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "backend/graph/graph_structure.h"
#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// True when the caller does not want the result any more; empty: never.
using StopRequest = std::function<bool()>;

/// Thrown out of the solvers, to whoever has taken the request from the caller. Nobody else sees it.
struct Stopped {};

inline void ThrowIfStopped(const StopRequest& stop) {
  if (stop && stop()) throw Stopped();
}

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

/// 1/2 sum rho(w e^T Omega e) over the edges, rho on loops only, as a function of the nodes that are not
/// constant. Edges of weight 0 are no part of the system of equations, and neither is their fill-in.
class GraphProblem {
 public:
  /// All of them outlive this object.
  GraphProblem(const PoseGraph& graph, const GraphStructure& structure, const PoseGraphOptions& options);
  virtual ~GraphProblem() = default;

  const PoseGraph& graph() const { return graph_; }
  const GraphStructure& structure() const { return structure_; }
  /// Coordinates of a node: 3, 6 or 7.
  int dimension() const { return static_cast<int>(TangentCoordinates(graph_.kind()).size()); }

  /// Chi-square beyond which a loop is doubted.
  double threshold() const { return threshold_; }
  void SetThreshold(double threshold) { threshold_ = threshold; }

  /// Poses of the nodes, and behind them of the landmarks, which are where they were if they are left out.
  virtual void SetPoses(const std::vector<Similarity>& poses) = 0;
  virtual std::vector<Similarity> Poses() const = 0;
  /// Landmarks' or priors.
  bool HasMeasurements() const { return !graph_.measurements().empty(); }

  /// e^T Omega e of one edge, weight not applied.
  virtual double EdgeChi2(std::size_t e) const = 0;
  bool IsLoop(std::size_t e) const { return graph_.edges()[e].kind == EdgeKind::kLoop; }
  /// What the options ask to minimise (no 1/2), at the present poses.
  double Objective() const;

  /// The loss on loop edges from now on; nullptr: least squares.
  void SetLoss(ceres::LossFunction* owned) { loss_.reset(owned); }
  ceres::LossFunction* loss() const { return loss_.get(); }

  double weight(std::size_t e) const { return weights_[e]; }
  /// Parallel to the edges, >= 0. They do not move in memory.
  const std::vector<double>& weights() const { return weights_; }
  void SetWeight(std::size_t e, double weight) { weights_[e] = weight; }
  /// The edges that count.
  std::vector<bool> Active() const;

  /// The next solution goes on with the trust region that the last one ended with, instead of a wide one. For
  /// rounds of few iterations, which would spend them all on narrowing it.
  void KeepTrustRegion() { trust_region_ = std::min(last_trust_region_, kInitialTrustRegion); }

  /// Solve() asks it before each iteration, and throws Stopped.
  void SetStop(StopRequest stop) { stop_ = std::move(stop); }

  SolveSummary Solve(int max_iterations, double max_time_s);

 protected:
  virtual double MeasurementChi2() const = 0;
  virtual SolveSummary Minimise(const SolveLimits& limits) = 0;

 private:
  const PoseGraph& graph_;
  const GraphStructure& structure_;
  const PoseGraphOptions& options_;
  double threshold_;
  std::vector<double> weights_;
  std::unique_ptr<ceres::LossFunction> loss_;
  StopRequest stop_;
  double trust_region_ = kInitialTrustRegion, last_trust_region_ = kInitialTrustRegion;
};

std::unique_ptr<GraphProblem> MakeGraphProblem(const PoseGraph& graph, const GraphStructure& structure,
                                               const PoseGraphOptions& options);

/// EvaluateCosts at other poses: of the nodes, and behind them of the landmarks.
GraphCosts CostsAt(const PoseGraph& graph, const std::vector<Similarity>& poses);

}  // namespace tutti::internal
