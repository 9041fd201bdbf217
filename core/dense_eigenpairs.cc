#include <Eigen/Eigenvalues>

#include "core/dense_solvers.h"
#include "core/eigen_bits.h"

namespace tutti::internal {
// The steps are those of Eigen::SelfAdjointEigenSolver.
Eigenpairs SymmetricEigen(const SmallMatrixRef& a) {
  const Eigen::Index n = a.rows();
  if (n == 1) return {a.col(0), SmallMatrix::Ones(1, 1)};
  SmallMatrix scaled = a.triangularView<Eigen::Lower>();
  double scale = scaled.cwiseAbs().maxCoeff();
  if (scale == 0) scale = 1;
  scaled.triangularView<Eigen::Lower>() /= scale;
  const Eigen::Tridiagonalization<SmallMatrix> decomposition(scaled);
  Eigenpairs out{decomposition.diagonal(), SmallMatrix::Identity(n, n)};
  Reflect(decomposition.packedMatrix(), decomposition.householderCoefficients(), 1, &out.vectors);
  SmallVector subdiagonal = decomposition.subDiagonal();
  constexpr Eigen::Index kMostIterations = Eigen::SelfAdjointEigenSolver<SmallMatrix>::m_maxIterations;
  Eigen::internal::computeFromTridiagonal_impl(out.values, subdiagonal, kMostIterations, true, out.vectors);
  out.values *= scale;
  return out;
}

}  // namespace tutti::internal
