#include <Eigen/Eigenvalues>

#include "core/dense_solvers.h"

namespace tutti::internal {

Eigenpairs SymmetricEigen(const SmallMatrixRef& a) {
  const Eigen::SelfAdjointEigenSolver<SmallMatrix> solver((SmallMatrix(a)));
  return {solver.eigenvalues(), solver.eigenvectors()};
}

}  // namespace tutti::internal
