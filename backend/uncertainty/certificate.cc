#include "tutti/backend/certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "backend/graph/graph_structure.h"
#include "backend/solver/block_cholesky.h"
#include "backend/solver/chordal_descent.h"
#include "core/dense_solvers.h"
#include "core/numbers.h"
#include "core/stopwatch.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::ChordalWeights;
using internal::GraphStructure;

/// Two fixed nodes in one part restrict the relative poses: another problem than the certificate's.
bool HasFreeGauge(const PoseGraph& graph, const GraphStructure& structure) {
  std::vector<int> fixed(structure.components.size(), 0);
  for (std::size_t k = 0; k < graph.nodes().size(); ++k) {
    if (graph.nodes()[k].fixed && ++fixed[structure.component_of[k]] > 1) return false;
  }
  return true;
}

/// The certificate matrix before the translations are eliminated: for each node one row of its translation,
/// then D of its rotation. Its Schur complement in the rotations is Q - L, so that the one is positive
/// definite where the other is. The translations of the anchors are left out (a one in their place).
template <int D>
class CertificateMatrix {
 public:
  using Rotation = Eigen::Matrix<double, D, D>;
  using Column = Eigen::Matrix<double, D, 1>;
  using Block = Eigen::Matrix<double, D + 1, D + 1>;

  /// `solution`: poses parallel to the nodes.
  CertificateMatrix(const PoseGraph& graph, const std::vector<Similarity>& solution,
                    const GraphStructure& structure)
      : structure_(structure), diagonal_(graph.nodes().size(), Block::Zero()) {
    const std::size_t edges = graph.edges().size();
    const internal::BlockPattern pattern(structure.ends, std::vector<bool>(graph.nodes().size(), false),
                                         std::vector<bool>(edges, true));
    off_diagonal_.assign(pattern.pairs.size(), Block::Zero());
    for (std::size_t e = 0; e < edges; ++e) {
      AddEdge(structure.ends[e], graph.edges()[e],
              internal::MakeChordalWeights(graph.edges()[e], graph.kind()), solution,
              off_diagonal_[pattern.pair_of_edge[e]]);
    }
    for (const std::size_t anchor : structure.anchor) diagonal_[anchor](0, 0) = 1;
    cholesky_.Analyse(pattern.unknowns, pattern.pairs);
  }

  /// Sum of the multipliers' traces: the dual value before the eigenvalue's share.
  double DualTrace() const { return dual_trace_; }
  double LargestRotationEntry() const {
    double largest = 0;
    for (const Block& block : diagonal_)
      largest = std::max(largest, block.diagonal().template tail<D>().cwiseAbs().maxCoeff());
    return largest;
  }

  /// True if lambda_min(Q - L) > -eta.
  bool IsPositiveDefiniteWith(double eta) {
    std::vector<Block> shifted = diagonal_;
    for (Block& block : shifted) block.diagonal().template tail<D>().array() += eta;
    return cholesky_.Factorise(shifted, off_diagonal_);
  }

  /// Lowers the multipliers where the matrix is indefinite; any multipliers give a bound. To lift an
  /// eigenvector v of the eigenvalue -l to zero, a shift of all rotations costs the bound D n l. The blocks
  /// |v_i|^2 v_i v_i^T that lift it cost l sum |v_i|^4 / sum |v_i|^6: as many l as v has nodes. (Blocks v_i
  /// v_i^T were tried, too: gaps of 0.048 and 0.018 where these leave 0.044 and 0.013.) The eigenvectors come
  /// from subspace iteration with the factor that IsPositiveDefiniteWith(eta) has left.
  void LowerMultipliers(double eta) {
    using internal::Index;
    constexpr int kVectors = 6, kSolves = 3;
    while (lowest_.size() < kVectors) lowest_.push_back(RandomVector());
    std::vector<Eigen::VectorXd> basis;
    for (int k = 0; k < kSolves; ++k) {
      Orthonormalise();
      basis = lowest_;
      for (Eigen::VectorXd& v : lowest_) cholesky_.Solve(v);
    }
    Eigen::Matrix<double, kVectors, kVectors> inverse;  // of Q - L + eta I in this basis
    for (int a = 0; a < kVectors; ++a) {
      for (int b = 0; b < kVectors; ++b) inverse(a, b) = basis[Index(a)].dot(lowest_[Index(b)]);
    }
    const internal::Eigenpairs pairs = internal::SymmetricEigen(inverse);
    for (Eigen::Index c = 0; c < pairs.values.size(); ++c) {
      const double eigenvalue = 1 / pairs.values(c) - eta;
      if (!(pairs.values(c) > 0 && eigenvalue < 0)) continue;
      Eigen::VectorXd v = Eigen::VectorXd::Zero(basis[0].size());
      for (int a = 0; a < kVectors; ++a) v += pairs.vectors(a, c) * basis[Index(a)];
      Lift(v, -eigenvalue);
    }
  }

 private:
  /// ||X c||^2 for the rows of X that belong to a node; `c`: what the edge multiplies them with.
  void AddEdge(const internal::EdgeEnds& ends, const PoseGraphEdge& edge, const ChordalWeights& weights,
               const std::vector<Similarity>& solution, Block& off_diagonal) {
    const double kappa = weights.rotation, tau = weights.translation;
    const Rotation R = edge.measurement.rotation.toRotationMatrix().template topLeftCorner<D, D>();
    const Column t = edge.measurement.translation.template head<D>();
    Eigen::Matrix<double, D + 1, 1> c_i, c_j;
    c_i << (IsAnchor(ends.from) ? 0 : -1), -t;
    c_j << (IsAnchor(ends.to) ? 0 : 1), Column::Zero();
    Block at_i = tau * c_i * c_i.transpose(), at_j = tau * c_j * c_j.transpose();
    at_i.template bottomRightCorner<D, D>() += kappa * Rotation::Identity();
    at_j.template bottomRightCorner<D, D>() += kappa * Rotation::Identity();
    Block between = tau * c_i * c_j.transpose();
    between.template bottomRightCorner<D, D>() -= kappa * R;
    diagonal_[ends.from] += at_i;
    diagonal_[ends.to] += at_j;
    if (ends.from > ends.to) {
      off_diagonal += between;
    } else {
      off_diagonal += between.transpose();
    }
    SubtractMultipliers(ends, R, t, weights, solution[ends.from], solution[ends.to]);
  }

  auto RotationOf(Eigen::VectorXd& v, std::size_t node) const {
    return v.template segment<D>((D + 1) * static_cast<Eigen::Index>(node) + 1);
  }

  Eigen::VectorXd RandomVector() {
    Eigen::VectorXd v(static_cast<Eigen::Index>((D + 1) * diagonal_.size()));
    for (double& x : v) x = random_() / 4294967296.0 - 0.5;
    return v;
  }

  /// Gram-Schmidt; the translations follow from the rotations and do not count.
  void Orthonormalise() {
    for (std::size_t a = 0; a < lowest_.size(); ++a) {
      for (std::size_t k = 0; k < diagonal_.size(); ++k)
        lowest_[a](static_cast<Eigen::Index>((D + 1) * k)) = 0;
      for (std::size_t b = 0; b < a; ++b) lowest_[a] -= lowest_[b].dot(lowest_[a]) * lowest_[b];
      lowest_[a].normalize();
    }
  }

  /// Adds to the diagonal what v, of length 1, needs for `by` more.
  void Lift(Eigen::VectorXd& v, double by) {
    double fourth = 0, sixth = 0;
    for (std::size_t k = 0; k < diagonal_.size(); ++k) {
      const double squared = RotationOf(v, k).squaredNorm();
      fourth += squared * squared;
      sixth += squared * squared * squared;
    }
    const double weight = by / sixth;
    for (std::size_t k = 0; k < diagonal_.size(); ++k) {
      const Column at = RotationOf(v, k);
      diagonal_[k].template bottomRightCorner<D, D>() += weight * at.squaredNorm() * at * at.transpose();
    }
    dual_trace_ -= weight * fourth;
  }

  bool IsAnchor(std::size_t node) const { return structure_.anchor[structure_.component_of[node]] == node; }

  /// L_i = sym(R_i^T (X M)_i): what the constraint R_i^T R_i = I pulls with at a stationary point.
  void SubtractMultipliers(const internal::EdgeEnds& ends, const Rotation& R, const Column& t,
                           const ChordalWeights& weights, const Similarity& pose_i,
                           const Similarity& pose_j) {
    const Rotation Ri = pose_i.rotation.toRotationMatrix().template topLeftCorner<D, D>();
    const Rotation Rj = pose_j.rotation.toRotationMatrix().template topLeftCorner<D, D>();
    const Column step = (pose_j.translation - pose_i.translation).template head<D>();
    const Rotation rotation = weights.rotation * (Rj - Ri * R);
    const Column translation = weights.translation * (step - Ri * t);
    const Rotation at_i = -Ri.transpose() * (rotation * R.transpose() + translation * t.transpose());
    const Rotation at_j = Rj.transpose() * rotation;
    diagonal_[ends.from].template bottomRightCorner<D, D>() -= 0.5 * (at_i + at_i.transpose());
    diagonal_[ends.to].template bottomRightCorner<D, D>() -= 0.5 * (at_j + at_j.transpose());
    dual_trace_ += at_i.trace() + at_j.trace();
  }

  const GraphStructure& structure_;
  std::vector<Block> diagonal_, off_diagonal_;
  double dual_trace_ = 0;
  std::vector<Eigen::VectorXd> lowest_;  // the subspace near the lowest eigenvalues
  std::mt19937 random_{1};
  internal::BlockCholesky<D + 1> cholesky_;
};

/// The smallest eta, within a factor of ten, that makes the matrix positive definite; it is no less than
/// `certifying` / 100, since what is below is only more digits. Negative if none up to `largest` does. Each
/// try is a factorisation: the usual case needs one.
template <int D>
double SmallestShift(CertificateMatrix<D>& matrix, double certifying, double largest,
                     const internal::StopRequest& stop) {
  for (const double tighter : {0.01, 0.1, 1.0}) {
    internal::ThrowIfStopped(stop);
    if (matrix.IsPositiveDefiniteWith(tighter * certifying)) return tighter * certifying;
  }
  int fails = 0, holds = 0;  // powers of ten
  while (certifying * std::pow(10, holds + 1) <= largest) ++holds;
  if (holds == 0 || !matrix.IsPositiveDefiniteWith(certifying * std::pow(10, holds))) return -1;
  while (holds - fails > 1) {
    internal::ThrowIfStopped(stop);
    const int middle = (fails + holds) / 2;
    (matrix.IsPositiveDefiniteWith(certifying * std::pow(10, middle)) ? holds : fails) = middle;
  }
  return certifying * std::pow(10, holds);
}

/// The bound by lower multipliers, where a shift of all rotations costs too much. Returns the shift that is
/// left.
template <int D>
double TightenBound(CertificateMatrix<D>& matrix, double eta, double traces,
                    const internal::StopRequest& stop, Certificate& out) {
  constexpr int kRounds = 20;       // each takes two or three factorisations
  constexpr double kEnough = 1e-3;  // share of the cost that the shift may take
  const auto shrink = [&](double factor) {
    const bool holds = matrix.IsPositiveDefiniteWith(factor * eta);
    if (holds) eta *= factor;
    return holds;
  };
  if (eta * traces <= kEnough * out.chordal) return eta;
  // Near the lowest eigenvalue its vectors come fast. It is known within a factor of ten, which is 0.7^7.
  for (int k = 0; k < 7 && shrink(0.7); ++k) internal::ThrowIfStopped(stop);
  out.lower_bound = matrix.DualTrace() - eta * traces;
  // The trace, which bounds what can be had, only falls.
  for (int round = 0; round < kRounds && eta * traces > kEnough * out.chordal &&
                      matrix.DualTrace() > std::max(0.0, out.lower_bound);
       ++round) {
    internal::ThrowIfStopped(stop);
    if (!matrix.IsPositiveDefiniteWith(eta)) break;
    matrix.LowerMultipliers(eta);
    if (!shrink(0.25)) shrink(0.5);
    out.lower_bound = std::max(out.lower_bound, matrix.DualTrace() - eta * traces);
  }
  return eta;
}

template <int D>
void Bound(const PoseGraph& graph, const std::vector<Similarity>& solution, const GraphStructure& structure,
           const CertificateOptions& options, const internal::StopRequest& stop, Certificate& out) {
  CertificateMatrix<D> matrix(graph, solution, structure);
  const double traces = D * static_cast<double>(graph.nodes().size());  // trace(R R^T) of any rotations
  const double largest = matrix.LargestRotationEntry();
  const double rounding = 1e-14 * largest;
  double eta = SmallestShift(matrix, std::max(rounding, options.certified_gap * out.chordal / traces),
                             options.max_shift * largest, stop);
  if (eta < 0) {
    out.reason = "the certificate matrix has a large negative eigenvalue";
    out.min_eigenvalue_bound = -std::numeric_limits<double>::infinity();
    out.relative_gap = 1;
    return;
  }
  out.lower_bound = matrix.DualTrace() - eta * traces;
  eta = TightenBound(matrix, eta, traces, stop, out);
  out.min_eigenvalue_bound = -eta;
  out.lower_bound = std::max(0.0, out.lower_bound);
  const double gap = std::max(0.0, out.chordal - out.lower_bound);
  out.relative_gap = out.chordal > 0 ? gap / out.chordal : 0;
  // A graph without noise has cost 0 up to rounding; a relative gap means nothing there.
  out.certified = gap <= std::max(options.certified_gap * out.chordal * (1 + 1e-9), 2 * rounding * traces);
  if (!out.certified) {
    out.reason = "poses of lower chordal cost may exist, or the bound is not tight for so much noise";
  }
}

Certificate Certify(const PoseGraph& graph, const CertificateOptions& options,
                    std::vector<Similarity> chordal_optimum, const internal::StopRequest& stop) {
  Certificate out;
  const GraphStructure structure = internal::AnalyseGraph(graph);
  if (graph.kind() == GraphKind::kSim3) {
    out.reason = "there is no certificate for graphs with scale";
  } else if (!graph.measurements().empty()) {
    out.reason = "there is no certificate for graphs with landmarks or priors";
  } else if (graph.edges().empty()) {
    out.reason = "the graph has no edges";
  } else if (!HasFreeGauge(graph, structure)) {
    out.reason = "several nodes of a connected part are fixed";
  }
  if (!out.reason.empty()) return out;
  if (chordal_optimum.empty()) {
    for (const PoseGraphNode& node : graph.nodes()) chordal_optimum.push_back(node.pose);
    constexpr int kIterations = 200;
    const internal::SolveSummary summary =
        internal::MinimiseChordal(graph, structure, kIterations, 0, chordal_optimum, stop);
    if (!summary.usable) {
      out.reason = "the chordal objective could not be minimised: " + summary.message;
      return out;
    }
  } else if (chordal_optimum.size() != graph.nodes().size()) {
    throw InputError("certificate: the chordal optimum has " + std::to_string(chordal_optimum.size()) +
                     " poses, the graph has " + std::to_string(graph.nodes().size()));
  }
  out.available = true;
  out.chordal = internal::ChordalCost(graph, chordal_optimum);
  if (graph.kind() == GraphKind::kSE2) {
    Bound<2>(graph, chordal_optimum, structure, options, stop, out);
  } else {
    Bound<3>(graph, chordal_optimum, structure, options, stop, out);
  }
  return out;
}

}  // namespace

std::string CertificateOptions::Validate() const {
  if (!(certified_gap > 0 && certified_gap < 1)) return "certificate: certified_gap must be in (0, 1)";
  if (!(max_shift > 0) || !std::isfinite(max_shift)) return "certificate: max_shift must be positive";
  return {};
}

Certificate CertifyOptimum(const PoseGraph& graph, const CertificateOptions& options,
                           std::vector<Similarity> chordal_optimum, const std::function<bool()>& stop) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
  const internal::Stopwatch watch;
  Certificate out;
  try {
    out = Certify(graph, options, std::move(chordal_optimum), stop);
  } catch (const internal::Stopped&) {
    out.reason = "stopped by the caller";
  }
  out.time_s = watch.Seconds();
  return out;
}

}  // namespace tutti
