#include "backend/graph/bad_information.h"

#include "core/dense_solvers.h"

namespace tutti::internal {

InformationFault FaultOf(const Matrix7d& information, GraphKind kind) {
  const std::vector<int> used = TangentCoordinates(kind);
  const Eigen::MatrixXd m = information(used, used);
  constexpr double kLargest = 1e100;    // beyond it costs overflow
  constexpr double kSmallest = 1e-100;  // below it they vanish, and their quotients are NaN
  if (!m.allFinite()) return InformationFault::kNotFinite;
  if (m.cwiseAbs().maxCoeff() > kLargest) return InformationFault::kTooLarge;
  if ((m - m.transpose()).cwiseAbs().maxCoeff() > 1e-9 * m.cwiseAbs().maxCoeff())
    return InformationFault::kNotSymmetric;
  const double largest = m.diagonal().maxCoeff();
  if (largest > 0 && largest < kSmallest) return InformationFault::kTooSmall;
  const CholeskyFactor factor = UpperCholesky(m);
  if (!factor.positive_definite) return InformationFault::kNotPositiveDefinite;
  // A factor whose diagonal collapses against the matrix' own is singular in all but rounding.
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    const double pivot = factor.upper(i, i) * factor.upper(i, i);
    if (!(pivot > 1e-13 * m(i, i))) return InformationFault::kNotPositiveDefinite;
  }
  return InformationFault::kNone;
}

bool IsPositiveSemidefinite(const Matrix7d& information) {
  constexpr double kLargest = 1e100, kRounding = 1e-9;
  if (!information.allFinite()) return false;
  const double size = information.cwiseAbs().maxCoeff();
  if (size > kLargest) return false;
  if ((information - information.transpose()).cwiseAbs().maxCoeff() > kRounding * size) return false;
  return SymmetricEigen(information).values(0) >= -kRounding * size;
}

Matrix7d Repaired(const Matrix7d& information, GraphKind kind, BadInformation how) {
  const std::vector<int> used = TangentCoordinates(kind);
  const Eigen::MatrixXd m = information(used, used);
  Matrix7d out = Matrix7d::Zero();
  if (how == BadInformation::kProject) {
    const Eigenpairs eigen = SymmetricEigen(m);
    const SmallVector& values = eigen.values;  // ascending
    const double largest = values(values.size() - 1);
    if (largest <= 0) return out;
    const Eigen::MatrixXd raised =
        eigen.vectors * values.cwiseMax(kLeastEigenvalue * largest).asDiagonal() * eigen.vectors.transpose();
    out(used, used) = 0.5 * (raised + raised.transpose());
  } else if (how == BadInformation::kDiagonal) {
    const Eigen::VectorXd values = m.diagonal();
    if (values.maxCoeff() <= 0) return out;
    out(used, used) = values.cwiseMax(kLeastEigenvalue * values.maxCoeff()).asDiagonal();
  }
  return out;
}

}  // namespace tutti::internal
