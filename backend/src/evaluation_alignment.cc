#include <Eigen/SVD>

#include "tutti/backend/evaluation.h"
#include "tutti/core/error.h"

namespace tutti {

TrajectoryAlignment ParseTrajectoryAlignment(const std::string& name) {
  for (TrajectoryAlignment alignment : {TrajectoryAlignment::kNone, TrajectoryAlignment::kOrigin,
                                        TrajectoryAlignment::kSE3, TrajectoryAlignment::kSim3}) {
    if (name == ToString(alignment)) return alignment;
  }
  throw InputError("unknown alignment '" + name + "'; use none, origin, se3 or sim3");
}

const char* ToString(TrajectoryAlignment alignment) {
  switch (alignment) {
    case TrajectoryAlignment::kNone:
      return "none";
    case TrajectoryAlignment::kOrigin:
      return "origin";
    case TrajectoryAlignment::kSE3:
      return "se3";
    case TrajectoryAlignment::kSim3:
      return "sim3";
  }
  return "?";
}

Similarity AlignPoints(const std::vector<Eigen::Vector3d>& reference,
                       const std::vector<Eigen::Vector3d>& estimate, bool with_scale) {
  const std::size_t n = reference.size();
  if (n != estimate.size()) throw InputError("alignment: the two lists of points differ in length");
  if (n < 3) {
    throw InputError("alignment: " + std::to_string(n) +
                     (n == 1 ? " pair of poses is" : " pairs of poses are") +
                     " too few, at least 3 are needed; use the alignment 'origin' or 'none'");
  }
  Eigen::Vector3d mean_r = Eigen::Vector3d::Zero(), mean_e = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < n; ++k) {
    mean_r += reference[k] / static_cast<double>(n);
    mean_e += estimate[k] / static_cast<double>(n);
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double variance_r = 0, variance_e = 0;
  for (std::size_t k = 0; k < n; ++k) {
    covariance += (reference[k] - mean_r) * (estimate[k] - mean_e).transpose() / static_cast<double>(n);
    variance_r += (reference[k] - mean_r).squaredNorm() / static_cast<double>(n);
    variance_e += (estimate[k] - mean_e).squaredNorm() / static_cast<double>(n);
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // The second singular value vanishes where one of the two lies on a line (all vanish where one stands
  // still). The bound is against the spread of the points, with room for the rounding of coordinates.
  if (!(svd.singularValues()(1) > 1e-14 * std::max(variance_r, variance_e)) || !(variance_e > 0)) {
    throw InputError(
        "alignment: the positions lie on a line or in one place, so the rotation is not determined; use the "
        "alignment "
        "'origin' or 'none'");
  }
  Eigen::Vector3d sign(1, 1, 1);  // Umeyama eq. (43): no reflection
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign.z() = -1;
  const Eigen::Matrix3d R = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  Similarity out;
  out.rotation = Eigen::Quaterniond(R).normalized();
  out.scale = with_scale ? svd.singularValues().dot(sign) / variance_e : 1.0;
  out.translation = mean_r - out.scale * (out.rotation * mean_e);
  return out;
}

Similarity AlignPoses(const AssociatedPoses& poses, TrajectoryAlignment alignment) {
  if (alignment == TrajectoryAlignment::kNone) return Similarity();
  if (alignment == TrajectoryAlignment::kOrigin) {
    return Similarity(poses.reference.front() * poses.estimate.front().Inverse());
  }
  std::vector<Eigen::Vector3d> reference, estimate;
  for (const Pose& pose : poses.reference) reference.push_back(pose.translation);
  for (const Pose& pose : poses.estimate) estimate.push_back(pose.translation);
  return AlignPoints(reference, estimate, alignment == TrajectoryAlignment::kSim3);
}

Pose ApplyAlignment(const Similarity& S, const Pose& pose) {
  return Pose((S.rotation * pose.rotation).normalized(), S * pose.translation);
}

}  // namespace tutti
