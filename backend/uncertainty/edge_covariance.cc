#include "backend/uncertainty/edge_covariance.h"

#include <Eigen/Core>
#include <array>
#include <limits>

#include "backend/graph/edge_error.h"
#include "core/dense_solvers.h"

namespace tutti::internal {
namespace {

double Distance(const SmallVector& d, const SmallMatrixRef& covariance) {
  const CholeskyFactor factor = UpperCholesky(covariance);
  if (!factor.positive_definite) return std::numeric_limits<double>::infinity();
  return factor.upper.transpose().triangularView<Eigen::Lower>().solve(d).squaredNorm();
}

}  // namespace

Matrix6d EdgeCovariance(const PoseGraphEdge& edge, GraphKind kind, GraphObjective objective) {
  const std::vector<int> used = TangentCoordinates(kind == GraphKind::kSE2 ? kind : GraphKind::kSE3);
  const Eigen::MatrixXd information = edge.information(used, used);
  Matrix6d out = Matrix6d::Zero();
  const Eigen::MatrixXd covariance = Inverse(information);
  out(used, used) = covariance;
  if (objective == GraphObjective::kChi2 && kind != GraphKind::kSE2) {
    out.bottomRows<3>() *= 2;
    out.rightCols<3>() *= 2;
  }
  return out;
}

Matrix6d Transported(const Matrix6d& covariance, const Pose& T_a_b) {
  const Eigen::Matrix3d R = T_a_b.rotation.toRotationMatrix();
  Matrix6d adjoint = Matrix6d::Zero();
  adjoint.topLeftCorner<3, 3>() = R;
  adjoint.bottomRightCorner<3, 3>() = R;
  adjoint.topRightCorner<3, 3>() = Skew(T_a_b.translation) * R;
  return adjoint * covariance * adjoint.transpose();
}

double Mahalanobis(const Vector6d& d, const Matrix6d& covariance, GraphKind kind) {
  if (kind == GraphKind::kSE2) {
    const std::array<int, 3> used = SolverOrder<3>();
    return Distance(d(used), covariance(used, used));
  }
  return Distance(d, covariance);
}

}  // namespace tutti::internal
