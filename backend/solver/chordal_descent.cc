#include "backend/solver/chordal_descent.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "backend/solver/block_system.h"
#include "core/least_squares.h"
#include "core/stopwatch.h"

namespace tutti::internal {
namespace {

/// What an edge needs again and again.
struct ChordalEdge {
  Eigen::Matrix3d R;  ///< R_ij
  Eigen::Vector3d t;  ///< t_ij
  double kappa = 1, tau = 1;
};

ChordalEdge MakeChordalEdge(const PoseGraphEdge& edge, GraphKind kind) {
  const ChordalWeights weights = MakeChordalWeights(edge, kind);
  return {edge.measurement.rotation.toRotationMatrix(), edge.measurement.translation, weights.rotation,
          weights.translation};
}

/// f of one edge to second order in the tangents (dt in the world, R Exp(dr)) of its two ends, of which the
/// off-diagonal block is the same for Gauss-Newton's Hessian and for the exact one.
struct SecondOrder {
  double cost = 0;
  Vector6d gradient_i, gradient_j;
  Matrix6d H_ii, H_jj, H_ij;                   ///< Gauss-Newton's
  Eigen::Matrix3d curvature_ii, curvature_jj;  ///< what the exact one has more, in the rotations
};

double Cost(const ChordalEdge& edge, const Similarity& i, const Similarity& j) {
  const Eigen::Matrix3d Ri = i.rotation.toRotationMatrix();
  const Eigen::Vector3d step = i.scale * (Ri * edge.t);
  return edge.kappa * (j.rotation.toRotationMatrix() - Ri * edge.R).squaredNorm() +
         edge.tau * (j.translation - i.translation - step).squaredNorm();
}

/// With E = R_ij^T R_i^T R_j, the rotations' part is 2 kappa (3 - tr E), and tr(Exp(-R_ij^T a) E Exp(b)) is
/// expanded to second order; the translations' part is tau ||R_i^T (t_j - t_i) - Exp(a) t_ij||^2.
SecondOrder Expand(const ChordalEdge& edge, const Similarity& i, const Similarity& j) {
  SecondOrder out;
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d Ri = i.rotation.toRotationMatrix(), Rj = j.rotation.toRotationMatrix();
  const Eigen::Matrix3d E = edge.R.transpose() * Ri.transpose() * Rj;
  const double k2 = 2 * edge.kappa, t2 = 2 * edge.tau;
  const Eigen::Vector3d odd(E(2, 1) - E(1, 2), E(0, 2) - E(2, 0), E(1, 0) - E(0, 1));
  const Eigen::Matrix3d even = (E.trace() - 2) * identity - 0.5 * (E + E.transpose());
  const Eigen::Vector3d r = Ri.transpose() * (j.translation - i.translation) - edge.t;
  const Eigen::Matrix3d T = Skew(edge.t), pull = t2 * Ri * T;
  out.cost = edge.kappa * (Rj - Ri * edge.R).squaredNorm() + edge.tau * r.squaredNorm();
  out.gradient_j << t2 * (Ri * r), k2 * odd;
  out.gradient_i << -t2 * (Ri * r), -k2 * (edge.R * odd) + t2 * r.cross(edge.t);
  out.H_jj << t2 * identity, Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero(), 2 * k2 * identity;
  out.H_ii << t2 * identity, -pull, -pull.transpose(), 2 * k2 * identity + t2 * T.transpose() * T;
  out.H_ij << -t2 * identity, Eigen::Matrix3d::Zero(), pull.transpose(),
      -k2 * edge.R * (E.trace() * identity - E.transpose());
  out.curvature_jj = k2 * even;
  const Eigen::Matrix3d outer = r * edge.t.transpose();
  out.curvature_ii = k2 * edge.R * even * edge.R.transpose() +
                     t2 * (r.dot(edge.t) * identity - 0.5 * (outer + outer.transpose()));
  return out;
}

/// N = 3: in the plane, where the coordinates x, y and heading of the spatial problem are all there is.
template <int N>
class ChordalDescent {
 public:
  using Block = Eigen::Matrix<double, N, N>;

  ChordalDescent(const PoseGraph& graph, const GraphStructure& structure,
                 const std::vector<Similarity>& poses)
      : structure_(structure),
        pattern_(structure.ends, structure.constant, std::vector<bool>(structure.ends.size(), true)),
        poses_(poses) {
    for (const PoseGraphEdge& edge : graph.edges()) edges_.push_back(MakeChordalEdge(edge, graph.kind()));
    system_.Analyse(pattern_.unknowns, pattern_.pairs);
  }

  SolveSummary Minimise(const SolveLimits& limits) {
    const Stopwatch watch;
    SolveSummary out;
    TrustRegion region;
    region.radius = limits.trust_region;
    out.usable = true;
    Linearise();
    if (!std::isfinite(cost_)) return Unusable("the chordal cost is not finite");
    out.converged = pattern_.unknowns == 0;
    while (!out.converged && out.iterations < limits.max_iterations) {
      if (limits.max_time_s > 0 && watch.Seconds() >= limits.max_time_s) break;
      ThrowIfStopped(limits.stop);
      // The first step leads from a relaxation or another objective's optimum, where residuals mislead.
      bool exact = out.iterations++ > 0;
      double expected = 0;
      exact = exact && FindStep(region.radius, true, expected);
      if (!exact && !FindStep(region.radius, false, expected)) {
        if (!region.Shrink()) return Unusable("the normal equations of the chordal cost have no solution");
        continue;
      }
      const std::vector<Similarity> before = poses_;
      Move();
      const double change = cost_ - Cost();
      // What lowers the cost by no more than its rounding can still lower the gradient.
      const bool last = expected <= kRounding * cost_ || step_.norm() <= kRounding;
      if (change > kMinQuality * expected || (last && change > -10 * kRounding * cost_)) {
        region.Grow(change / expected);
        if (!last) Linearise();
        out.converged = last;
      } else {
        poses_ = before;
        region.radius = std::min(region.radius, limits.trust_region);  // beyond, it damps nothing
        out.converged = last || !region.Shrink();
      }
    }
    return out;
  }

  const std::vector<Similarity>& poses() const { return poses_; }

 private:
  static constexpr double kMinQuality = 1e-3;  // least share of the expected decrease that makes a step
  static constexpr double kRounding = 1e-13;

  static SolveSummary Unusable(const char* why) {
    SolveSummary out;
    out.message = why;
    return out;
  }

  static std::array<int, N> Used() {
    if constexpr (N == 3) return {0, 1, 5};
    if constexpr (N == 6) return {0, 1, 2, 3, 4, 5};
  }
  static Block Part(const Matrix6d& m) { return m(Used(), Used()); }
  static constexpr int kRotations = N == 3 ? 1 : 3;
  static Eigen::Matrix<double, kRotations, kRotations> Part(const Eigen::Matrix3d& m) {
    return m.template bottomRightCorner<kRotations, kRotations>();
  }

  double Cost() const {
    double sum = 0;
    for (std::size_t e = 0; e < edges_.size(); ++e)
      sum += internal::Cost(edges_[e], poses_[structure_.ends[e].from], poses_[structure_.ends[e].to]);
    return sum;
  }

  void Linearise() {
    const auto unknowns = static_cast<std::size_t>(pattern_.unknowns);
    diagonal_.assign(unknowns, Block::Zero());
    curvature_.assign(unknowns, Block::Zero());
    off_diagonal_.assign(pattern_.pairs.size(), Block::Zero());
    gradient_ = Eigen::VectorXd::Zero(N * pattern_.unknowns);
    cost_ = 0;
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      const EdgeEnds& ends = structure_.ends[e];
      const SecondOrder f = Expand(edges_[e], poses_[ends.from], poses_[ends.to]);
      cost_ += f.cost;
      const int i = pattern_.unknown[ends.from], j = pattern_.unknown[ends.to];
      if (i >= 0) AddEnd(static_cast<std::size_t>(i), f.H_ii, f.curvature_ii, f.gradient_i);
      if (j >= 0) AddEnd(static_cast<std::size_t>(j), f.H_jj, f.curvature_jj, f.gradient_j);
      if (i < 0 || j < 0) continue;
      const Block H_ij = Part(f.H_ij);
      Block& off = off_diagonal_[pattern_.pair_of_edge[e]];  // row: the larger unknown
      if (i > j) {
        off += H_ij;
      } else {
        off += H_ij.transpose();
      }
    }
  }

  void AddEnd(std::size_t unknown, const Matrix6d& H, const Eigen::Matrix3d& curvature,
              const Vector6d& gradient) {
    diagonal_[unknown] += Part(H);
    curvature_[unknown].template bottomRightCorner<kRotations, kRotations>() += Part(curvature);
    gradient_.template segment<N>(N * static_cast<Eigen::Index>(unknown)) += gradient(Used());
  }

  /// Solves (H + D / radius) step = -gradient, D the diagonal of Gauss-Newton's Hessian.
  bool FindStep(double radius, bool exact, double& expected) {
    std::vector<Block> damped = diagonal_;
    Eigen::VectorXd damping(gradient_.size());
    for (std::size_t k = 0; k < damped.size(); ++k) {
      const Eigen::Matrix<double, N, 1> d = diagonal_[k].diagonal().cwiseMax(1e-12) / radius;
      damped[k].diagonal() += d;
      if (exact) damped[k] += curvature_[k];
      damping.segment<N>(N * static_cast<Eigen::Index>(k)) = d;
    }
    step_ = -gradient_;
    if (!system_.Solve(damped, off_diagonal_, step_)) return false;
    expected = 0.5 * (step_.dot(damping.cwiseProduct(step_)) - gradient_.dot(step_));
    return true;
  }

  void Move() {
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      if (pattern_.unknown[k] < 0) continue;
      const Eigen::Matrix<double, N, 1> d = step_.segment<N>(N * pattern_.unknown[k]);
      Vector6d tangent = Vector6d::Zero();
      tangent(Used()) = d;
      poses_[k].translation += tangent.head<3>();
      poses_[k].rotation = (poses_[k].rotation * ExpSO3(tangent.tail<3>())).normalized();
    }
  }

  const GraphStructure& structure_;
  BlockPattern pattern_;
  std::vector<ChordalEdge> edges_;  // parallel to edges
  std::vector<Similarity> poses_;   // parallel to nodes
  double cost_ = 0;
  std::vector<Block> diagonal_, curvature_, off_diagonal_;
  Eigen::VectorXd gradient_, step_;
  BlockSystem<N> system_;
};

template <int N>
SolveSummary Minimise(const PoseGraph& graph, const GraphStructure& structure, const SolveLimits& limits,
                      std::vector<Similarity>& poses) {
  ChordalDescent<N> descent(graph, structure, poses);
  SolveSummary summary = descent.Minimise(limits);
  if (summary.usable) poses = descent.poses();
  return summary;
}

}  // namespace

ChordalWeights MakeChordalWeights(const PoseGraphEdge& edge, GraphKind kind) {
  if (kind == GraphKind::kSE2) {
    const Eigen::Matrix2d tt = edge.information.topLeftCorner<2, 2>();
    return {edge.information(5, 5), 2.0 / tt.inverse().trace()};
  }
  const Eigen::Matrix3d tt = edge.information.topLeftCorner<3, 3>();
  const Eigen::Matrix3d rr = edge.information.block<3, 3>(3, 3);
  return {3.0 / (2.0 * rr.inverse().trace()), 3.0 / tt.inverse().trace()};
}

SolveSummary MinimiseChordal(const PoseGraph& graph, const GraphStructure& structure, int max_iterations,
                             double max_time_s, std::vector<Similarity>& poses, const StopRequest& stop) {
  SolveLimits limits;
  limits.max_iterations = max_iterations;
  limits.max_time_s = max_time_s;
  limits.stop = stop;
  return graph.kind() == GraphKind::kSE2 ? Minimise<3>(graph, structure, limits, poses)
                                         : Minimise<6>(graph, structure, limits, poses);
}

double ChordalCost(const PoseGraph& graph, const std::vector<Similarity>& poses) {
  double sum = 0;
  for (const PoseGraphEdge& edge : graph.edges())
    sum += Cost(MakeChordalEdge(edge, graph.kind()), poses[graph.IndexOf(edge.from)],
                poses[graph.IndexOf(edge.to)]);
  return sum;
}

}  // namespace tutti::internal
