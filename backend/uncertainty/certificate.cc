#include "tutti/backend/certificate.h"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "backend/graph/edge_weights.h"
#include "backend/graph/graph_structure.h"
#include "core/stopwatch.h"
#include "tutti/backend/pose_graph_optimizer.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::ChordalWeights;
using internal::GraphStructure;

/// The graph whose chi2 is the chordal cost: ||R(E) - I||_F^2 = 8 |vec(q(E))|^2, in the plane as in space. A
/// planar graph becomes a spatial one that stays in its plane, for there is no force out of it.
PoseGraph ChordalGraph(const PoseGraph& graph) {
  PoseGraph out(GraphKind::kSE3);
  for (const PoseGraphNode& node : graph.nodes()) out.AddNode(node);
  for (PoseGraphEdge edge : graph.edges()) {
    const ChordalWeights weights = internal::MakeChordalWeights(edge, graph.kind());
    Vector7d diagonal;
    diagonal << Eigen::Vector3d::Constant(weights.translation),
        Eigen::Vector3d::Constant(8.0 * weights.rotation), 1.0;
    edge.information = diagonal.asDiagonal();
    out.AddEdge(edge);
  }
  return out;
}

/// Two fixed nodes in one part restrict the relative poses: another problem than the certificate's.
bool HasFreeGauge(const PoseGraph& graph, const GraphStructure& structure) {
  std::vector<int> fixed(structure.components.size(), 0);
  for (std::size_t k = 0; k < graph.nodes().size(); ++k) {
    if (graph.nodes()[k].fixed && ++fixed[structure.component_of[k]] > 1) return false;
  }
  return true;
}

/// The certificate matrix before the translations are eliminated: one row for each translation (the anchors'
/// left out), then D rows for each rotation. Its Schur complement in the rotations is Q - L, so that the one
/// is positive definite where the other is.
template <int D>
class CertificateMatrix {
 public:
  using Block = Eigen::Matrix<double, D, D>;
  using Column = Eigen::Matrix<double, D, 1>;

  /// `solution` has the same nodes in the same order as `graph`.
  CertificateMatrix(const PoseGraph& graph, const PoseGraph& solution, const GraphStructure& structure)
      : translation_row_(graph.nodes().size(), -1), diagonal_(graph.nodes().size(), Block::Zero()) {
    for (std::size_t k = 0; k < translation_row_.size(); ++k) {
      if (structure.anchor[structure.component_of[k]] != k) translation_row_[k] = translations_++;
    }
    for (std::size_t e = 0; e < graph.edges().size(); ++e) {
      const PoseGraphEdge& edge = graph.edges()[e];
      const internal::EdgeEnds& ends = structure.ends[e];
      AddEdge(ends, edge, internal::MakeChordalWeights(edge, graph.kind()), solution.nodes()[ends.from].pose,
              solution.nodes()[ends.to].pose);
    }
    for (std::size_t k = 0; k < diagonal_.size(); ++k)
      InsertBlock(RotationRow(k), RotationRow(k), diagonal_[k]);
    matrix_.resize(size(), size());
    matrix_.setFromTriplets(triplets_.begin(), triplets_.end());
    triplets_ = {};
    cholesky_.analyzePattern(matrix_);
  }

  /// Sum of the multipliers' traces: the dual value before the eigenvalue's share.
  double DualTrace() const { return dual_trace_; }
  double LargestRotationEntry() const { return matrix_.diagonal().tail(D * nodes()).cwiseAbs().maxCoeff(); }

  /// True if lambda_min(Q - L) > -eta.
  bool IsPositiveDefiniteWith(double eta) {
    Eigen::SparseMatrix<double> shifted = matrix_;
    for (int row = translations_; row < size(); ++row) shifted.coeffRef(row, row) += eta;
    cholesky_.factorize(shifted);
    return cholesky_.info() == Eigen::Success;
  }

 private:
  int nodes() const { return static_cast<int>(diagonal_.size()); }
  int size() const { return translations_ + D * nodes(); }
  int RotationRow(std::size_t node) const { return translations_ + D * static_cast<int>(node); }

  /// Lower triangle only.
  void Insert(int row, int column, double value) {
    if (row >= column) triplets_.emplace_back(row, column, value);
  }
  void InsertBlock(int row, int column, const Block& block) {
    for (int r = 0; r < D; ++r) {
      for (int c = 0; c < D; ++c) Insert(row + r, column + c, block(r, c));
    }
  }

  void AddEdge(const internal::EdgeEnds& ends, const PoseGraphEdge& edge, const ChordalWeights& weights,
               const Similarity& pose_i, const Similarity& pose_j) {
    const double kappa = weights.rotation, tau = weights.translation;
    const Block R = edge.measurement.rotation.toRotationMatrix().template topLeftCorner<D, D>();
    const Column t = edge.measurement.translation.template head<D>();
    diagonal_[ends.from] += kappa * Block::Identity() + tau * t * t.transpose();
    diagonal_[ends.to] += kappa * Block::Identity();
    if (ends.from > ends.to) {
      InsertBlock(RotationRow(ends.from), RotationRow(ends.to), -kappa * R);
    } else {
      InsertBlock(RotationRow(ends.to), RotationRow(ends.from), -kappa * R.transpose());
    }
    const int i = translation_row_[ends.from], j = translation_row_[ends.to];
    if (i >= 0) Insert(i, i, tau);
    if (j >= 0) Insert(j, j, tau);
    if (i >= 0 && j >= 0) Insert(std::max(i, j), std::min(i, j), -tau);
    for (int r = 0; r < D; ++r) {
      if (i >= 0) Insert(RotationRow(ends.from) + r, i, tau * t(r));
      if (j >= 0) Insert(RotationRow(ends.from) + r, j, -tau * t(r));
    }
    SubtractMultipliers(ends, R, t, weights, pose_i, pose_j);
  }

  /// L_i = sym(R_i^T (X M)_i): what the constraint R_i^T R_i = I pulls with at a stationary point.
  void SubtractMultipliers(const internal::EdgeEnds& ends, const Block& R, const Column& t,
                           const ChordalWeights& weights, const Similarity& pose_i,
                           const Similarity& pose_j) {
    const Block Ri = pose_i.rotation.toRotationMatrix().template topLeftCorner<D, D>();
    const Block Rj = pose_j.rotation.toRotationMatrix().template topLeftCorner<D, D>();
    const Column step = (pose_j.translation - pose_i.translation).template head<D>();
    const Block rotation = weights.rotation * (Rj - Ri * R);
    const Column translation = weights.translation * (step - Ri * t);
    const Block at_i = -Ri.transpose() * (rotation * R.transpose() + translation * t.transpose());
    const Block at_j = Rj.transpose() * rotation;
    diagonal_[ends.from] -= 0.5 * (at_i + at_i.transpose());
    diagonal_[ends.to] -= 0.5 * (at_j + at_j.transpose());
    dual_trace_ += at_i.trace() + at_j.trace();
  }

  std::vector<int> translation_row_;  // -1: an anchor
  std::vector<Block> diagonal_;       // of the rotations' rows
  int translations_ = 0;
  double dual_trace_ = 0;
  std::vector<Eigen::Triplet<double>> triplets_;
  Eigen::SparseMatrix<double> matrix_;
  Eigen::SimplicialLLT<Eigen::SparseMatrix<double>> cholesky_;
};

/// The smallest eta, within a factor of ten, that makes the matrix positive definite; starts at the largest
/// one that still certifies. Negative if none up to `largest` does.
template <int D>
double SmallestShift(CertificateMatrix<D>& matrix, double certifying, double largest) {
  constexpr int kTighter = 3;  // factors of ten beyond what is asked for; each costs a factorisation
  double eta = certifying;
  if (matrix.IsPositiveDefiniteWith(eta)) {
    for (int k = 0; k < kTighter && matrix.IsPositiveDefiniteWith(0.1 * eta); ++k) eta *= 0.1;
    return eta;
  }
  for (eta *= 10; eta <= largest; eta *= 10) {
    if (matrix.IsPositiveDefiniteWith(eta)) return eta;
  }
  return -1;
}

template <int D>
void Bound(const PoseGraph& graph, const PoseGraph& solution, const GraphStructure& structure,
           const CertificateOptions& options, Certificate& out) {
  CertificateMatrix<D> matrix(graph, solution, structure);
  const double traces = D * static_cast<double>(graph.nodes().size());  // trace(R R^T) of any rotations
  const double largest = matrix.LargestRotationEntry();
  const double rounding = 1e-14 * largest;
  const double eta = SmallestShift(matrix, std::max(rounding, options.certified_gap * out.chordal / traces),
                                   options.max_shift * largest);
  if (eta < 0) {
    out.reason = "the certificate matrix has a large negative eigenvalue";
    out.min_eigenvalue_bound = -std::numeric_limits<double>::infinity();
    out.relative_gap = 1;
    return;
  }
  out.min_eigenvalue_bound = -eta;
  out.lower_bound = std::max(0.0, matrix.DualTrace() - eta * traces);
  const double gap = std::max(0.0, out.chordal - out.lower_bound);
  out.relative_gap = out.chordal > 0 ? gap / out.chordal : 0;
  // A graph without noise has cost 0 up to rounding; a relative gap means nothing there.
  out.certified = gap <= std::max(options.certified_gap * out.chordal * (1 + 1e-9), 2 * rounding * traces);
  if (!out.certified) {
    out.reason = "poses of lower chordal cost may exist, or the bound is not tight for so much noise";
  }
}

}  // namespace

std::string CertificateOptions::Validate() const {
  if (!(certified_gap > 0 && certified_gap < 1)) return "certificate: certified_gap must be in (0, 1)";
  if (!(max_shift > 0) || !std::isfinite(max_shift)) return "certificate: max_shift must be positive";
  return {};
}

Certificate CertifyOptimum(const PoseGraph& graph, const CertificateOptions& options) {
  const std::string wrong = options.Validate();
  if (!wrong.empty()) throw InputError(wrong);
  const internal::Stopwatch watch;
  Certificate out;
  const GraphStructure structure = internal::AnalyseGraph(graph);
  if (graph.kind() == GraphKind::kSim3) {
    out.reason = "there is no certificate for graphs with scale";
  } else if (graph.edges().empty()) {
    out.reason = "the graph has no edges";
  } else if (!HasFreeGauge(graph, structure)) {
    out.reason = "several nodes of a connected part are fixed";
  }
  if (!out.reason.empty()) return out;
  PoseGraph solution = ChordalGraph(graph);
  PoseGraphOptions polish;
  polish.objective = GraphObjective::kChi2;
  polish.init = GraphInit::kFile;
  polish.solver = PoseGraphSolver::kBlock;
  polish.function_tolerance = 1e-16;  // the multipliers are only as good as the gradient is small
  const PoseGraphReport report = PoseGraphOptimizer(polish).Optimize(solution);
  if (!report.success) {
    out.reason = "the chordal objective could not be minimised: " + report.reason;
    return out;
  }
  out.available = true;
  out.chordal = report.costs.chi2;
  if (graph.kind() == GraphKind::kSE2) {
    Bound<2>(graph, solution, structure, options, out);
  } else {
    Bound<3>(graph, solution, structure, options, out);
  }
  out.time_s = watch.Seconds();
  return out;
}

}  // namespace tutti
