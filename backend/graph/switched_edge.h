// Switchable constraints (Suenderhauf and Protzel, IROS 2012). Private to the back end.
#pragma once

#include <ceres/ceres.h>

#include <cmath>

#include "backend/graph/edge_error.h"

namespace tutti::internal {

/// A loop edge times its switch s, which is a variable of the problem: residual s S e. Together with the
/// prior below the optimum over s alone is s = c2 / (c2 + e^T Omega e), the loss then that of Geman and
/// McClure.
template <int N>
class SwitchedEdgeCost final : public ceres::SizedCostFunction<N, BlockSize<N>(), BlockSize<N>(), 1> {
 public:
  /// `edge` outlives this object.
  explicit SwitchedEdgeCost(const ceres::CostFunction& edge) : edge_(edge) {}

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    using Lifted = Eigen::Matrix<double, N, BlockSize<N>(), Eigen::RowMajor>;
    using Residuals = Eigen::Map<Eigen::Matrix<double, N, 1>>;
    const double s = parameters[2][0];
    if (!edge_.Evaluate(parameters, residuals, jacobians)) return false;
    for (int k = 0; k < 2; ++k) {
      if (jacobians != nullptr && jacobians[k] != nullptr) Eigen::Map<Lifted>{jacobians[k]} *= s;
    }
    if (jacobians != nullptr && jacobians[2] != nullptr) Residuals{jacobians[2]} = Residuals{residuals};
    Residuals{residuals} *= s;
    return true;
  }

 private:
  const ceres::CostFunction& edge_;
};

/// Switches want to be on: residual sqrt(c2) (1 - s).
class SwitchPrior final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit SwitchPrior(double c2) : root_(std::sqrt(c2)) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    residuals[0] = root_ * (1 - parameters[0][0]);
    if (jacobians != nullptr && jacobians[0] != nullptr) jacobians[0][0] = -root_;
    return true;
  }

 private:
  double root_;
};

}  // namespace tutti::internal
