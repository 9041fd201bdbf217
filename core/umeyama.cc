#include "core/umeyama.h"

#include <algorithm>

#include "core/dense_solvers.h"

namespace tutti::internal {

std::optional<Similarity> Umeyama(const std::vector<Eigen::Vector3d>& a,
                                  const std::vector<Eigen::Vector3d>& b, bool with_scale) {
  if (a.size() < 3 || a.size() != b.size()) return std::nullopt;
  const double n = static_cast<double>(a.size());
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < a.size(); ++i) {
    mean_a += a[i] / n;
    mean_b += b[i] / n;
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double variance_a = 0, variance_b = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    covariance += (a[i] - mean_a) * (b[i] - mean_b).transpose() / n;
    variance_a += (a[i] - mean_a).squaredNorm() / n;
    variance_b += (b[i] - mean_b).squaredNorm() / n;
  }
  const Svd3 svd = SingularValues(covariance);
  // The second singular value vanishes where one of the two lies on a line (all vanish where one stands
  // still). The bound is against the spread of the points, with room for the rounding of coordinates.
  if (!(svd.values(1) > 1e-14 * std::max(variance_a, variance_b)) || !(variance_b > 0)) {
    return std::nullopt;
  }
  Eigen::Vector3d sign(1, 1, 1);  // eq. 43: no reflection
  if (svd.u.determinant() * svd.v.determinant() < 0) sign.z() = -1;
  const Eigen::Matrix3d rotation = svd.u * sign.asDiagonal() * svd.v.transpose();
  Similarity S;
  S.rotation = Eigen::Quaterniond(rotation).normalized();
  S.scale = with_scale ? svd.values.dot(sign) / variance_b : 1.0;
  S.translation = mean_a - S.scale * (S.rotation * mean_b);
  return S;
}

}  // namespace tutti::internal
