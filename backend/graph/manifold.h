// The one place that knows whether Ceres has Manifold (2.1 and later) or LocalParameterization (2.0).
//
// A 3D node is one block [t (3), q = x y z w (4)] or, with scale, [t (3), log s (1), q (4)]; its tangent is
// (dt, dr) or (dt, dls, dr) and the update t + dt, log s + dls, q * Exp(dr). Cost functions write their
// Jacobian with respect to the tangent into the first columns and zero into the last one ("lifting"), so that
// the manifold's own Jacobian is [I; 0] and costs nothing to evaluate.
#pragma once

#include <ceres/ceres.h>
#include <ceres/version.h>

#include <Eigen/Core>

#include "tutti/core/pose.h"

#define TUTTI_CERES_HAS_MANIFOLD \
  (CERES_VERSION_MAJOR > 2 || (CERES_VERSION_MAJOR == 2 && CERES_VERSION_MINOR >= 1))

namespace tutti::internal {

#if TUTTI_CERES_HAS_MANIFOLD
using ManifoldBase = ceres::Manifold;
#else
using ManifoldBase = ceres::LocalParameterization;
#endif

/// kFlat: number of coordinates before the quaternion, which just add up (3 for SE(3), 4 for Sim(3)).
template <int kFlat>
class NodeManifold final : public ManifoldBase {
 public:
  static constexpr int kAmbient = kFlat + 4;
  static constexpr int kTangent = kFlat + 3;
  using Jacobian = Eigen::Matrix<double, kAmbient, kTangent, Eigen::RowMajor>;
  using InverseJacobian = Eigen::Matrix<double, kTangent, kAmbient, Eigen::RowMajor>;

  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    for (int i = 0; i < kFlat; ++i) x_plus_delta[i] = x[i] + delta[i];
    const Eigen::Map<const Eigen::Quaterniond> q(x + kFlat);
    Eigen::Map<Eigen::Quaterniond> out(x_plus_delta + kFlat);
    out = (q * ExpSO3(Eigen::Map<const Eigen::Vector3d>(delta + kFlat))).normalized();
    return true;
  }
#if TUTTI_CERES_HAS_MANIFOLD
  int AmbientSize() const override { return kAmbient; }
  int TangentSize() const override { return kTangent; }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Jacobian>(jacobian).setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    for (int i = 0; i < kFlat; ++i) y_minus_x[i] = y[i] - x[i];
    const Eigen::Map<const Eigen::Quaterniond> qy(y + kFlat), qx(x + kFlat);
    Eigen::Map<Eigen::Vector3d>(y_minus_x + kFlat) = LogSO3(qx.conjugate() * qy);
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<InverseJacobian>(jacobian).setIdentity();
    return true;
  }
#else
  int GlobalSize() const override { return kAmbient; }
  int LocalSize() const override { return kTangent; }
  bool ComputeJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Jacobian>(jacobian).setIdentity();
    return true;
  }
#endif
};

/// Adds a block that moves on its manifold (nullptr: flat). The problem does not take ownership.
inline void AddBlock(ceres::Problem& problem, double* block, int size, ManifoldBase* manifold) {
  if (manifold == nullptr) {
    problem.AddParameterBlock(block, size);
  } else {
    problem.AddParameterBlock(block, size, manifold);
  }
}

inline void DoNotOwnManifolds(ceres::Problem::Options& options) {
#if TUTTI_CERES_HAS_MANIFOLD
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
#else
  options.local_parameterization_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
#endif
}

}  // namespace tutti::internal
