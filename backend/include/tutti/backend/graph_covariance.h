// How well does a graph know its poses? Marginal covariances at the present poses, by sparse Cholesky.
//
// With H = sum of J^T Omega J over the edges (Gauss-Newton's matrix, the anchors left out) the covariance of
// the poses is H^-1; only the columns that are asked for are solved. A loop is gated with it: its error e at
// the present poses has covariance (loop's own) + (relative pose's), so d^2 = e^T C^-1 e is chi-square
// distributed if the loop is true, and it is what the loop would add to the cost of the graph.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "tutti/backend/pose_graph.h"

#pragma GCC visibility push(default)
namespace tutti {

class GraphCovariance {
 public:
  /// Factorises the graph at its present poses, which should be its optimum; all edges count with weight 1,
  /// and the information is that of kChi2Log (rotation vectors). Throws InputError if it can't be factorised.
  explicit GraphCovariance(const PoseGraph& graph);
  ~GraphCovariance();
  GraphCovariance(const GraphCovariance&) = delete;
  GraphCovariance& operator=(const GraphCovariance&) = delete;

  /// 3x3 (x, y, heading), 6x6 (translation, rotation) or 7x7 (and log scale) covariance of a node that moves
  /// by (t + dt, R Exp(dr), log s + dls), translation in the world [m^2, m rad, rad^2]; zero for anchors.
  /// Throws InputError for an unknown id.
  Eigen::MatrixXd OfPose(int id) const;
  /// Covariance of S_from_to as the graph has it, as a perturbation in the frame of `to`. Throws InputError
  /// for an unknown id, or if no edges connect the two.
  Eigen::MatrixXd OfRelativePose(int from, int to) const;
  /// Squared Mahalanobis distance [1] of a measurement that is not in the graph yet. Same errors.
  double SquaredDistance(const PoseGraphEdge& measurement) const;
  /// True if edges connect the two nodes.
  bool Connected(int from, int to) const;

  class Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace tutti
#pragma GCC visibility pop
