// Robust losses rho(s) of s = e^T Omega e, with rho ~ s near zero. Private to the back end.
//
//   Huber  rho = s up to c2, then 2 sqrt(c2 s) - c2                             weight sqrt(c2 / s)
//   Cauchy rho = c2 log(1 + s / c2)                                             weight c2 / (c2 + s)
//   DCS    rho = s up to c2, then c2 (3 s - c2) / (c2 + s), bounded by 3 c2     weight (2 c2 / (c2 + s))^2
//          (Agarwal et al., ICRA 2013; as a loss: MacTavish & Barfoot, CRV 2015)
//   TLS    rho = min(s, c2): what GNC minimises                                 weight 0 or 1
#pragma once

#include <ceres/loss_function.h>

#include <cmath>

#include "core/least_squares.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

inline double RobustCost(RobustLoss robust, double s, double c2) {
  if (robust == RobustLoss::kCauchy) return c2 * std::log1p(s / c2);
  if (robust == RobustLoss::kNone || s <= c2) return s;
  if (robust == RobustLoss::kHuber) return HuberCost(s, c2);
  if (robust == RobustLoss::kDcs) return c2 * (3.0 * s - c2) / (c2 + s);
  return c2;
}

/// Derivative of the loss: the weight of the edge in the normal equations. GNC keeps its own weights.
inline double RobustWeight(RobustLoss robust, double s, double c2) {
  if (robust == RobustLoss::kCauchy) return c2 / (c2 + s);
  if (robust == RobustLoss::kNone || s <= c2) return 1.0;
  if (robust == RobustLoss::kHuber) return HuberWeight(s, c2);
  if (robust == RobustLoss::kDcs) return 4.0 * c2 * c2 / ((c2 + s) * (c2 + s));
  return 0.0;
}

/// Geman-McClure, rho = c2 s / (c2 + s): the surrogate that GNC tightens until only inliers matter.
class GemanMcClureLoss final : public ceres::LossFunction {
 public:
  explicit GemanMcClureLoss(double c2) : c2_(c2) {}
  void Evaluate(double s, double rho[3]) const override {
    const double k = c2_ / (c2_ + s);
    rho[0] = k * s;
    rho[1] = k * k;
    rho[2] = -2.0 * k * k / (c2_ + s);
  }

 private:
  double c2_;
};

class DcsLoss final : public ceres::LossFunction {
 public:
  explicit DcsLoss(double c2) : c2_(c2) {}
  void Evaluate(double s, double rho[3]) const override {
    rho[0] = RobustCost(RobustLoss::kDcs, s, c2_);
    rho[1] = RobustWeight(RobustLoss::kDcs, s, c2_);
    rho[2] = s <= c2_ ? 0.0 : -2.0 * rho[1] / (c2_ + s);
  }

 private:
  double c2_;
};

/// 99 % quantile of the chi-square distribution with 3, 6 or 7 degrees of freedom.
inline double ChiSquare99(int degrees_of_freedom) {
  return degrees_of_freedom == 3 ? 11.344867 : degrees_of_freedom == 6 ? 16.811894 : 18.475307;
}

/// Its median.
inline double ChiSquareMedian(int degrees_of_freedom) {
  return degrees_of_freedom == 3 ? 2.365974 : degrees_of_freedom == 6 ? 5.348121 : 6.345811;
}

}  // namespace tutti::internal
