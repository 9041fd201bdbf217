// The chordal objective with rotations that may leave space: D orthonormal columns of R^r instead of R^D.
// Private to the back end.
//
// With r large enough the problem has no local minima but the optimum of the convex relaxation (Burer and
// Monteiro; SE-Sync: Rosen et al., IJRR 2019, problem 9 and section 4.2), whose multipliers give the best
// bound that a certificate can have. Minimised by a Riemannian trust region with truncated conjugate
// gradients (Absil, Mahony, Sepulchre, Optimization Algorithms on Matrix Manifolds, 2008, algorithms 10 and
// 11), preconditioned by the quadratic form itself, which is factorised once.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

#include "backend/solver/block_cholesky.h"

namespace tutti::internal {

/// kappa ||R_j - R_i R||^2 + tau ||t_j - t_i - R_i t||^2.
template <int D>
struct ChordalTerm {
  std::size_t i = 0, j = 0;  ///< positions of the nodes
  Eigen::Matrix<double, D, D> R;
  Eigen::Matrix<double, D, 1> t;
  double kappa = 1, tau = 1;
};

template <int D>
class LiftedRelaxation {
 public:
  /// Strong noise was seen to need D + 2.
  static constexpr int kRank = D + 3;
  /// A node: its translation, then the columns of its rotation.
  using Point = Eigen::Matrix<double, kRank, D + 1>;
  using Rotation = Eigen::Matrix<double, D, D>;
  using Points = std::vector<Point>;
  /// The quadratic form, or one near it, factorised.
  using Preconditioner = BlockCholesky<D + 1>;

  /// `anchors`: whether a node's translation is held. Keeps a reference to the terms.
  LiftedRelaxation(const std::vector<ChordalTerm<D>>& terms, std::vector<bool> anchors,
                   std::vector<Point> start);

  /// `products`: the most times that the form is applied. Ends where the cost falls by less than `tolerance`
  /// of it. Calls `check` now and then.
  void Minimise(const Preconditioner& form, int products, double tolerance,
                const std::function<void()>& check);

  double cost() const { return cost_; }
  /// Of the constraints that a rotation's columns are orthonormal: sym(R_i^T (X Q)_i), whose traces sum up to
  /// the cost where the gradient vanishes.
  std::vector<Rotation> Multipliers() const { return MultipliersOf(Product(points_)); }

 private:
  Points Product(const Points& v) const;
  std::vector<Rotation> MultipliersOf(const Points& product) const;
  // Onto the tangent space at points_.
  void Project(Points& v) const;
  void Precondition(const Preconditioner& form, Points& v) const;
  // The step of the model within the trust region, what the model expects of it, and whether it ends inside.
  Points Step(const Preconditioner& form, double radius, int& products, double& expected, bool& inside) const;
  Points Moved(const Points& step) const;
  double CostOf(const Points& points) const;

  const std::vector<ChordalTerm<D>>& terms_;
  std::vector<bool> anchors_;
  Points points_;
  double cost_ = 0;
  Points gradient_;
  std::vector<Rotation> multipliers_;
};

extern template class LiftedRelaxation<2>;
extern template class LiftedRelaxation<3>;

}  // namespace tutti::internal
