#include <Eigen/Eigenvalues>
#include <cmath>

#include "core/dense_solvers.h"

namespace tutti::internal {

Eigenpairs RealEigen(const SmallMatrixRef& a, double most_imaginary) {
  const Eigen::EigenSolver<SmallMatrix> solver((SmallMatrix(a)));
  Eigenpairs out;
  if (solver.info() != Eigen::Success) return out;
  const auto& values = solver.eigenvalues();
  const auto vectors = solver.eigenvectors();
  out.values.resize(a.rows());
  out.vectors.resize(a.rows(), a.rows());
  Eigen::Index found = 0;
  for (Eigen::Index i = 0; i < a.rows(); ++i) {
    if (std::abs(values(i).imag()) > most_imaginary) continue;
    out.values(found) = values(i).real();
    for (Eigen::Index r = 0; r < a.rows(); ++r) out.vectors(r, found) = vectors(r, i).real();
    ++found;
  }
  out.values.conservativeResize(found);
  out.vectors.conservativeResize(a.rows(), found);
  return out;
}

}  // namespace tutti::internal
