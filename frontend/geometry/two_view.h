// Relative pose of two views from matched pixels: mono initialisation.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tutti/core/camera.h"
#include "tutti/core/pose.h"

namespace tutti {

struct TwoViewOptions {
  double pixel_sigma = 1.0;       ///< standard deviation of a matched pixel [px]
  double min_parallax_deg = 1.0;  ///< median parallax of the triangulated points [deg]
  int min_points = 60;            ///< points that must triangulate in front of both cameras
};

struct TwoViewResult {
  bool success = false;
  std::string reason;                   ///< why not, in plain words
  bool homography = false;              ///< the planar model explained the matches better
  Pose T_second_first;                  ///< |translation| = 1
  std::vector<Eigen::Vector3d> points;  ///< in the first camera; one per match
  std::vector<char> valid;              ///< one per match: triangulated well
  double parallax_deg = 0;
};

/// Chooses between essential matrix (RANSAC) and homography by their robust scores (Mur-Artal et al., T-RO
/// 2015, section IV), triangulates, and takes the motion that puts most points in front of both cameras.
/// Deterministic.
TwoViewResult EstimateTwoView(const PinholeCamera& camera, const std::vector<cv::Point2f>& first,
                              const std::vector<cv::Point2f>& second, const TwoViewOptions& options);

/// A point that two views see.
struct TwoViewPoint {
  Eigen::Vector3d in_first;  ///< in the first camera, in units of the motion's translation
  double first_sigma_px = 1, second_sigma_px = 1;  ///< standard deviations of its pixels, each axis
};

/// How well two views know in which direction the camera moved, whatever its turn and the points are: the
/// standard deviation in the most uncertain direction [rad]. Infinite if the points leave a motion open.
/// Where it is large, a turn and a sideways step look the same, and the motion may well be an opposite one
/// with all depths wrong.
double DirectionSigma(const PinholeCamera& camera, const Pose& T_second_first,
                      const std::vector<TwoViewPoint>& points);

/// Linear triangulation of a point from two rays (x/z, y/z, 1) and T_second_first; in the first camera.
Eigen::Vector3d Triangulate(const Eigen::Vector3d& first_ray, const Eigen::Vector3d& second_ray,
                            const Pose& T_second_first);

}  // namespace tutti

namespace tutti::internal {

/// Those E (Frobenius norm 1) with b' E a = 0 for five pairs of rays a = (x/z, y/z, 1) in the first view and
/// b in the second: none to ten; none where pairs repeat each other.
/// D. Nister, "An efficient solution to the five-point relative pose problem", PAMI 2004, for the
/// constraints; H. Stewenius, C. Engels, D. Nister, "Recent developments on direct relative orientation",
/// ISPRS 2006, for their solution by eigenvectors.
std::vector<Eigen::Matrix3d> FivePointEssential(const Eigen::Matrix<double, 5, 2>& first,
                                                const Eigen::Matrix<double, 5, 2>& second);

struct EssentialMatrix {
  Eigen::Matrix3d matrix;
  int inliers = 0;
};

/// The one that most pairs agree with, by RANSAC over five pairs: those whose Sampson distance is at most
/// `threshold` (as a tangent, hence pixels by the focal length). None if fewer than five do. It ends when a
/// better one is less likely than 1 - `confidence`, or after 1000 samples.
/// cv::findEssentialMat does the same, but its bits depend on the processor; these do not.
std::optional<EssentialMatrix> FitEssential(const std::vector<Eigen::Vector2d>& first,
                                            const std::vector<Eigen::Vector2d>& second, double threshold,
                                            double confidence);

}  // namespace tutti::internal
