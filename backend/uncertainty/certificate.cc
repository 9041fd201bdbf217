#include "tutti/backend/certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "backend/graph/graph_structure.h"
#include "backend/solver/block_cholesky.h"
#include "backend/solver/chordal_descent.h"
#include "backend/uncertainty/lifted_relaxation.h"
#include "core/dense_solvers.h"
#include "core/numbers.h"
#include "core/stopwatch.h"
#include "tutti/core/error.h"

namespace tutti {
namespace {

using internal::ChordalTerm;
using internal::ChordalWeights;
using internal::GraphStructure;
using internal::LiftedRelaxation;

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
      : form_(graph.nodes().size(), Block::Zero()), anchors_(graph.nodes().size(), false) {
    for (const std::size_t anchor : structure.anchor) anchors_[anchor] = true;
    const std::size_t edges = graph.edges().size();
    const internal::BlockPattern pattern(structure.ends, std::vector<bool>(graph.nodes().size(), false),
                                         std::vector<bool>(edges, true));
    off_diagonal_.assign(pattern.pairs.size(), Block::Zero());
    for (std::size_t e = 0; e < edges; ++e) {
      const PoseGraphEdge& edge = graph.edges()[e];
      const ChordalWeights weights = internal::MakeChordalWeights(edge, graph.kind());
      terms_.push_back({structure.ends[e].from, structure.ends[e].to,
                        edge.measurement.rotation.toRotationMatrix().template topLeftCorner<D, D>(),
                        edge.measurement.translation.template head<D>(), weights.rotation,
                        weights.translation});
      AddTerm(terms_.back(), off_diagonal_[pattern.pair_of_edge[e]]);
    }
    for (const std::size_t anchor : structure.anchor) form_[anchor](0, 0) = 1;
    cholesky_.Analyse(pattern.unknowns, pattern.pairs);
    for (const Similarity& pose : solution) {
      points_.push_back(Point::Zero());
      points_.back().template topLeftCorner<D, 1>() = pose.translation.template head<D>();
      points_.back().template block<D, D>(0, 1) =
          pose.rotation.toRotationMatrix().template topLeftCorner<D, D>();
    }
    SetMultipliers(LiftedRelaxation<D>(terms_, anchors_, points_).Multipliers());
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

  /// The multipliers of the relaxation take the place of the solution's, which are far from the best where
  /// the relaxation is not tight. The first call minimises it from the solution, bent out of space along the
  /// lowest eigenvectors, and needs the factor of IsPositiveDefiniteWith(eta); another one goes on. The
  /// factor is lost. `tolerance`: share of the cost that the last step may have lowered it by.
  void Relax(double eta, double tolerance, const internal::StopRequest& stop) {
    constexpr int kProducts = 1500;
    if (!relaxed_) relaxed_.emplace(terms_, anchors_, BentSolution(eta));
    std::vector<Block> shifted = form_;
    for (Block& block : shifted)
      block.diagonal().template tail<D>().array() +=
          relaxed_->cost() / (D * static_cast<double>(form_.size()));
    if (!cholesky_.Factorise(shifted, off_diagonal_)) return;
    relaxed_->Minimise(cholesky_, kProducts, tolerance, [&] { internal::ThrowIfStopped(stop); });
    SetMultipliers(relaxed_->Multipliers());
  }

  /// Lowers the multipliers where the matrix is indefinite; any multipliers give a bound. To lift an
  /// eigenvector v of the eigenvalue -l to zero, a shift of all rotations costs the bound D n l. The blocks
  /// |v_i|^2 v_i v_i^T that lift it cost l sum |v_i|^4 / sum |v_i|^6: as many l as v has nodes. (Blocks v_i
  /// v_i^T were tried, too: gaps of 0.048 and 0.018 where these leave 0.044 and 0.013.) After
  /// IsPositiveDefiniteWith(eta).
  void LowerMultipliers(double eta) {
    for (auto& [v, eigenvalue] : LowestVectors(eta)) {
      if (eigenvalue < 0) Lift(v, -eigenvalue);
    }
  }

 private:
  using Point = typename LiftedRelaxation<D>::Point;

  std::vector<Point> BentSolution(double eta) {
    constexpr double kMost = 0.3;  // length that a component of an eigenvector adds to a column
    std::vector<Point> bent = points_;
    int row = D;
    for (auto& [v, eigenvalue] : LowestVectors(eta)) {
      if (eigenvalue >= 0 || row == LiftedRelaxation<D>::kRank) continue;
      double most = 0;
      for (std::size_t k = 0; k < bent.size(); ++k)
        most = std::max(most, RotationOf(v, k).cwiseAbs().maxCoeff());
      for (std::size_t k = 0; k < bent.size(); ++k) {
        const auto at = static_cast<Eigen::Index>((D + 1) * k);
        bent[k].row(row) = kMost / most * v.template segment<D + 1>(at).transpose();
      }
      ++row;
    }
    return bent;
  }

  /// The lowest eigenvectors, of length 1, and their eigenvalues by subspace iteration with the factor of Q -
  /// L + eta I; the lowest one comes first.
  std::vector<std::pair<Eigen::VectorXd, double>> LowestVectors(double eta) {
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
    std::vector<std::pair<Eigen::VectorXd, double>> out;
    for (Eigen::Index c = pairs.values.size(); c-- > 0;) {
      if (!(pairs.values(c) > 0)) continue;
      Eigen::VectorXd v = Eigen::VectorXd::Zero(basis[0].size());
      for (int a = 0; a < kVectors; ++a) v += pairs.vectors(a, c) / pairs.values(c) * lowest_[Index(a)];
      out.emplace_back(std::move(v), 1 / pairs.values(c) - eta);
    }
    return out;
  }

  void SetMultipliers(const std::vector<Rotation>& multipliers) {
    diagonal_ = form_;
    dual_trace_ = 0;
    for (std::size_t k = 0; k < multipliers.size(); ++k) {
      diagonal_[k].template bottomRightCorner<D, D>() -= multipliers[k];
      dual_trace_ += multipliers[k].trace();
    }
  }

  /// ||X c||^2 for the rows of X that belong to a node; `c`: what the edge multiplies them with.
  void AddTerm(const ChordalTerm<D>& term, Block& off_diagonal) {
    Eigen::Matrix<double, D + 1, 1> c_i, c_j;
    c_i << (anchors_[term.i] ? 0 : -1), -term.t;
    c_j << (anchors_[term.j] ? 0 : 1), Column::Zero();
    Block at_i = term.tau * c_i * c_i.transpose(), at_j = term.tau * c_j * c_j.transpose();
    at_i.template bottomRightCorner<D, D>() += term.kappa * Rotation::Identity();
    at_j.template bottomRightCorner<D, D>() += term.kappa * Rotation::Identity();
    Block between = term.tau * c_i * c_j.transpose();
    between.template bottomRightCorner<D, D>() -= term.kappa * term.R;
    form_[term.i] += at_i;
    form_[term.j] += at_j;
    if (term.i > term.j) {
      off_diagonal += between;
    } else {
      off_diagonal += between.transpose();
    }
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

  std::vector<ChordalTerm<D>> terms_;
  std::vector<Block> form_, diagonal_, off_diagonal_;  // form_: the diagonal of Q
  std::vector<bool> anchors_;
  std::vector<Point> points_;  // the solution
  std::optional<LiftedRelaxation<D>> relaxed_;
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

/// The bound by better multipliers, where a shift of all rotations costs too much. `eta`: the shift that
/// SmallestShift found. Returns the one that is left.
template <int D>
double TightenBound(CertificateMatrix<D>& matrix, double eta, double traces, double certifying,
                    double largest, const internal::StopRequest& stop, Certificate& out) {
  constexpr int kRounds = 20;       // each takes two or three factorisations
  constexpr double kEnough = 1e-3;  // share of the cost that the shift may take
  constexpr double kGood = 0.02;    // gap that is not worth more time
  const auto shrink = [&](double factor) {
    internal::ThrowIfStopped(stop);
    const bool holds = matrix.IsPositiveDefiniteWith(factor * eta);
    if (holds) eta *= factor;
    return holds;
  };
  // Whether the bound is worth more time; if so, the factor is that of `eta`, which is near the lowest
  // eigenvalue, where its vectors come fast.
  const auto not_enough = [&] {
    const auto much = [&] { return eta * traces > kEnough * out.chordal; };
    while (much() && shrink(0.5)) continue;
    if (much()) shrink(0.7);
    out.lower_bound = std::max(out.lower_bound, matrix.DualTrace() - eta * traces);
    return much() && matrix.IsPositiveDefiniteWith(eta);
  };
  if (!not_enough()) return eta;
  for (const double tolerance : {1e-4, 1e-5, 1e-6}) {
    matrix.Relax(eta, tolerance, stop);
    const double relaxed = SmallestShift(matrix, certifying, largest, stop);
    if (relaxed < 0) return eta;
    eta = relaxed;
    // The trace, which bounds what can be had, only falls.
    for (int round = 0; not_enough() && round < kRounds && matrix.DualTrace() > out.lower_bound; ++round)
      matrix.LowerMultipliers(eta);
    if (out.chordal - out.lower_bound <= kGood * out.chordal) return eta;
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
  const double certifying = std::max(rounding, options.certified_gap * out.chordal / traces);
  double eta = SmallestShift(matrix, certifying, options.max_shift * largest, stop);
  if (eta < 0) {
    out.reason = "the certificate matrix has a large negative eigenvalue";
    out.min_eigenvalue_bound = -std::numeric_limits<double>::infinity();
    out.relative_gap = 1;
    return;
  }
  out.lower_bound = matrix.DualTrace() - eta * traces;
  eta = TightenBound(matrix, eta, traces, certifying, options.max_shift * largest, stop, out);
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
