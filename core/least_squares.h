// What solvers of small least squares problems share. Not installed.
//
// K. Madsen, H. B. Nielsen and O. Tingleff, "Methods for Non-Linear Least Squares Problems", 2nd edition
// 2004.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "core/dense_solvers.h"

namespace tutti::internal {

/// Huber's loss of a squared residual `s`: s up to `c2`, beyond it as its root (P. J. Huber 1964).
inline double HuberCost(double s, double c2) { return s <= c2 ? s : 2.0 * std::sqrt(c2 * s) - c2; }
/// Its derivative: the weight of the squared residual.
inline double HuberWeight(double s, double c2) { return s <= c2 ? 1.0 : std::sqrt(c2 / s); }

/// The damping 1 / radius of Levenberg-Marquardt by Nielsen's rule, as in Ceres.
struct TrustRegion {
  double radius = 1e4, factor = 2;
  /// After a step that lowered the cost. `quality`: how much it fell, in units of what was expected.
  void Grow(double quality) {
    const double x = 2 * quality - 1;
    radius = std::min(1e16, radius / std::max(1.0 / 3.0, 1 - x * x * x));
    factor = 2;
  }
  /// After one that did not. False if there is nothing left of it.
  bool Shrink() {
    radius /= factor;
    factor *= 2;
    return radius > 1e-32;
  }
};

/// J^T W J and J^T W r of N unknowns, and the cost that they are of.
template <int N>
struct NormalEquations {
  Eigen::Matrix<double, N, N> hessian = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, N, 1> gradient = Eigen::Matrix<double, N, 1>::Zero();
  double cost = 0;

  template <int M>
  void Add(const Eigen::Matrix<double, M, N>& jacobian, const Eigen::Matrix<double, M, 1>& residual,
           double weight) {
    hessian.noalias() += weight * jacobian.transpose() * jacobian;
    gradient.noalias() += weight * jacobian.transpose() * residual;
  }
};

/// When GaussNewton ends, whichever comes first.
struct GaussNewtonLimits {
  int iterations = 10;
  double step_tolerance = 0;  ///< norm of a step; 0: never
  double cost_tolerance = 0;  ///< change of the cost in units of the cost; 0: never
  double damping = 0;         ///< is added to the diagonal, in units of the trace
};

/// Gauss-Newton: no step is taken back, so the start must be near. `linearise(NormalEquations<N>&)` fills the
/// equations where the unknowns are now; `move(step)` moves them, and is false if that led nowhere. False if
/// the equations had no solution or a move led nowhere.
template <int N, typename Linearise, typename Move>
bool GaussNewton(const GaussNewtonLimits& limits, const Linearise& linearise, const Move& move) {
  using Matrix = Eigen::Matrix<double, N, N>;
  double last_cost = 0;
  for (int iteration = 0; iteration < limits.iterations; ++iteration) {
    NormalEquations<N> equations;
    linearise(equations);
    if (!equations.gradient.allFinite()) return false;  // LDLT would answer with no step at all
    const double damping = limits.damping * equations.hessian.trace();
    const Eigen::Matrix<double, N, 1> step =
        SolveLdlt<N>(equations.hessian + damping * Matrix::Identity(), -equations.gradient);
    if (!step.allFinite() || !move(step)) return false;
    if (step.norm() < limits.step_tolerance) break;
    if (iteration > 0 && std::abs(last_cost - equations.cost) < limits.cost_tolerance * equations.cost) break;
    last_cost = equations.cost;
  }
  return true;
}

}  // namespace tutti::internal
