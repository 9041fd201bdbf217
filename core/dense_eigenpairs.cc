#include <Eigen/Eigenvalues>

#include "core/dense_solvers.h"

namespace tutti::internal {
namespace {

// The orthogonal matrix of a tridiagonal decomposition. As matrixQ(), without what Eigen's template adds for
// matrices of more than 48 columns.
SmallMatrix HouseholderQ(const Eigen::Tridiagonalization<SmallMatrix>& decomposition) {
  const SmallMatrix& vectors = decomposition.packedMatrix();
  const auto coefficients = decomposition.householderCoefficients();
  const Eigen::Index n = vectors.rows();
  SmallMatrix q = SmallMatrix::Identity(n, n);
  SmallVector workspace(n);
  for (Eigen::Index k = n - 1; k-- > 0;) {
    const Eigen::Index rows = n - 1 - k;
    q.bottomRightCorner(rows, rows)
        .applyHouseholderOnTheLeft(vectors.col(k).tail(rows - 1), coefficients(k), workspace.data());
  }
  return q;
}

}  // namespace

// As Eigen::SelfAdjointEigenSolver does it.
Eigenpairs SymmetricEigen(const SmallMatrixRef& a) {
  const Eigen::Index n = a.rows();
  if (n == 1) return {a.col(0), SmallMatrix::Ones(1, 1)};
  SmallMatrix scaled = a.triangularView<Eigen::Lower>();
  double scale = scaled.cwiseAbs().maxCoeff();
  if (scale == 0) scale = 1;
  scaled.triangularView<Eigen::Lower>() /= scale;
  const Eigen::Tridiagonalization<SmallMatrix> decomposition(scaled);
  Eigenpairs out{decomposition.diagonal(), HouseholderQ(decomposition)};
  SmallVector subdiagonal = decomposition.subDiagonal();
  constexpr Eigen::Index kMostIterations = Eigen::SelfAdjointEigenSolver<SmallMatrix>::m_maxIterations;
  Eigen::internal::computeFromTridiagonal_impl(out.values, subdiagonal, kMostIterations, true, out.vectors);
  out.values *= scale;
  return out;
}

}  // namespace tutti::internal
