// Relative pose of two cameras from matched features: PnP on 3D points, and Sim(3) on points known in both.
//
// The loop-closure module uses these for verification; a SLAM pipeline uses them again with its own, fresher
// points.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

#pragma GCC visibility push(default)
namespace tutti {

/// Options of SolvePnp and SolveSimilarity.
struct RelativePoseOptions {
  double threshold_px = 2.5;   ///< reprojection error of an inlier [px]
  double pixel_sigma = 1.5;    ///< standard deviation of a matched pixel, sets the information matrix [px]
  int min_inliers = 8;         ///< fewer are no solution
  double confidence = 0.9999;  ///< of RANSAC, 0..1
  int max_iterations = 1000;   ///< of RANSAC
  int refine_rounds = 5;       ///< rounds of refinement and re-selection of inliers
  std::uint64_t seed = 1;      ///< of RANSAC

  /// Empty if usable, else what is wrong and what to do.
  std::string Validate() const;
};

/// Outcome of SolvePnp.
struct PnpResult {
  bool success = false;                     ///< enough inliers; else only `reason` means something
  std::string reason;                       ///< why not, in plain words
  Pose T_camera_points;                     ///< maps the points' frame into the camera of the pixels
  Matrix6d information = Matrix6d::Zero();  ///< of T_points_camera = T_camera_points^-1; see SolvePnp
  std::vector<int> inliers;                 ///< indices, ascending
  double rmse_px = 0;                       ///< of the inliers
};

/// PnP by RANSAC (P3P on three, checked on all), refined by Gauss-Newton on the inliers with a Huber loss.
///
/// points[i] (any frame, [m]) is seen at pixels[i] (distorted as the camera says). `point_sigma_m`: empty, or
/// each point's standard deviation [m], which then adds to the pixel noise in the information. The
/// information matrix is of the inverse pose T_points_camera under the perturbation T * Exp(tangent), tangent
/// = (translation, rotation) in the camera frame: J^T W J over the inliers, W = 1 / variance of a residual,
/// in 1/m^2 and 1/rad^2. Deterministic for a seed.
PnpResult SolvePnp(const std::vector<Eigen::Vector3d>& points, const std::vector<Eigen::Vector2d>& pixels,
                   const PinholeCamera& camera, const RelativePoseOptions& options,
                   const std::vector<double>& point_sigma_m = {});

/// Outcome of SolveSimilarity.
struct SimilarityResult {
  bool success = false;  ///< enough inliers; else only `reason` means something
  std::string reason;    ///< why not, in plain words
  Similarity S_a_b;      ///< maps points of camera b into camera a
  Matrix7d information =
      Matrix7d::Zero();      ///< under S * (Exp(translation, rotation), e^scale), log scale last
  std::vector<int> inliers;  ///< indices, ascending
  double rmse_px = 0;        ///< over both images, inliers only
};

/// Sim(3) by RANSAC on three 3D-3D matches, inliers judged by the reprojection error in both images, refined
/// on the inliers by Gauss-Newton on the same errors (as ORB-SLAM's loop correction does; Strasdat et al.
/// 2010 for the group).
///
/// points_a[i] in camera a [its own unit] is the same point as points_b[i] in camera b; pixels likewise.
/// Deterministic.
SimilarityResult SolveSimilarity(const std::vector<Eigen::Vector3d>& points_a,
                                 const std::vector<Eigen::Vector2d>& pixels_a, const PinholeCamera& camera_a,
                                 const std::vector<Eigen::Vector3d>& points_b,
                                 const std::vector<Eigen::Vector2d>& pixels_b, const PinholeCamera& camera_b,
                                 const RelativePoseOptions& options);

}  // namespace tutti
#pragma GCC visibility pop
