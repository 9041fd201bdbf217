// Camera pose from landmarks: a first one without any guess, and robust refinement on all inliers.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "core/least_squares.h"
#include "core/reprojection.h"
#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti {

/// One landmark seen by a feature.
struct PointObservation {
  Eigen::Vector3d point;           ///< in the world [m]
  Eigen::Vector2d pixel;           ///< measured [px]
  double pixel_sigma = 1;          ///< standard deviation [px]
  double inverse_depth = 0;        ///< measured 1/z [1/m]; 0 if unknown
  double inverse_depth_sigma = 0;  ///< [1/m]; <= 0 if unknown
};

/// Nearer points are not seen [m].
constexpr double kMinDepth = 1e-3;

/// Pixel and inverse depth in standard deviations; inverse depth has weight 0 where it is unknown.
inline internal::Reprojection<3>::Measurement InSigmas(const PointObservation& o) {
  const double pixel = 1.0 / o.pixel_sigma;
  return {{o.pixel.x(), o.pixel.y(), o.inverse_depth},
          {pixel, pixel, o.inverse_depth_sigma > 0 ? 1.0 / o.inverse_depth_sigma : 0.0}};
}

/// Reprojection residual, in standard deviations: (du, dv, d(1/z)); the last is 0 where depth is unknown.
/// False if the point lies behind the camera. `jacobian`: d residual / d (translation, rotation) of a left
/// perturbation of T_camera_world, 3x6; may be null.
bool ReprojectionResidual(const PinholeCamera& camera, const Pose& T_camera_world,
                          const PointObservation& observation, Eigen::Vector3d* residual,
                          Eigen::Matrix<double, 3, 6>* jacobian);

/// 95 % quantiles of chi2 for 2 and 3 degrees of freedom: the bound between inlier and outlier, and what
/// squared residuals count by the Huber loss beyond.
inline double ChiSquareBound(const PointObservation& o) { return o.inverse_depth_sigma > 0 ? 7.815 : 5.991; }

/// Robust Gauss-Newton over N unknowns in four rounds, each on the inliers of the round before; Huber's loss
/// bounds what the others of a round count, but in the last one. Ends where fewer than `least` are left.
/// Returns the number of inliers; `inlier` has one flag per observation. `residual(observation, &r,
/// &jacobian)` is ReprojectionResidual by the unknowns, `prior(&equations)` adds what else is known, `move`
/// is GaussNewton's.
template <int N, class Residual, class Prior, class Move>
int RefineOnInliers(const std::vector<PointObservation>& observations,
                    const internal::GaussNewtonLimits& limits, int least, const Residual& residual,
                    const Prior& prior, const Move& move, std::vector<char>* inlier) {
  constexpr int kRounds = 4;
  using Jacobian = Eigen::Matrix<double, 3, N>;
  inlier->assign(observations.size(), 1);
  int inliers = 0;
  for (int round = 0; round < kRounds; ++round) {
    const bool robust = round + 1 < kRounds;
    const auto linearise = [&](internal::NormalEquations<N>& equations) {
      for (std::size_t i = 0; i < observations.size(); ++i) {
        Eigen::Vector3d r;
        Jacobian j;
        if (!(*inlier)[i] || !residual(observations[i], &r, &j)) continue;
        const double s = r.squaredNorm(), bound = robust ? ChiSquareBound(observations[i]) : INFINITY;
        equations.Add(j, r, internal::HuberWeight(s, bound));
        equations.cost += internal::HuberCost(s, bound);
      }
      prior(&equations);
    };
    internal::GaussNewton<N>(limits, linearise, move);
    inliers = 0;
    for (std::size_t i = 0; i < observations.size(); ++i) {
      Eigen::Vector3d r;
      (*inlier)[i] = residual(observations[i], &r, static_cast<Jacobian*>(nullptr)) &&
                     r.squaredNorm() <= ChiSquareBound(observations[i]);
      inliers += (*inlier)[i];
    }
    if (inliers < least) break;
  }
  return inliers;
}

/// RefineOnInliers over the pose.
int RefinePose(const PinholeCamera& camera, const std::vector<PointObservation>& observations,
               Pose* T_camera_world, std::vector<char>* inlier);

/// T_camera_world from points in the world [m] and their pixels, with outliers among them: PnP in RANSAC
/// (cv::solvePnPRansac, whose random numbers are the same every time). None if fewer than `least_inliers`
/// come within 5 px, or if the points are degenerate.
std::optional<Pose> SolvePnp(const PinholeCamera& camera, const std::vector<Eigen::Vector3d>& points,
                             const std::vector<cv::Point2f>& pixels, int least_inliers);

}  // namespace tutti
