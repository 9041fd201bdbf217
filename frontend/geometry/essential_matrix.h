// The essential matrix of two views of one calibrated camera.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

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
