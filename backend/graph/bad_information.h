// Information matrices that are not positive definite, made into ones that are. Private to the back end.
#pragma once

#include "tutti/backend/g2o_io.h"
#include "tutti/backend/pose_graph.h"

namespace tutti::internal {

/// What CheckInformation finds.
enum class InformationFault { kNone, kNotFinite, kTooLarge, kTooSmall, kNotSymmetric, kNotPositiveDefinite };
InformationFault FaultOf(const Matrix7d& information, GraphKind kind);
/// Symmetric, of sizes that costs can be computed with, and no eigenvalue below 0 but for rounding.
bool IsPositiveSemidefinite(const Matrix7d& information);

/// What is left of a symmetric matrix that is not positive definite; zero if nothing is: then the edge has to
/// go. kProject: the nearest positive semidefinite one in the Frobenius norm (Higham 1988), its eigenvalues
/// of 0 raised to kLeast of the largest, since a Cholesky factor has to exist. kDiagonal: the entries of the
/// diagonal that are positive, the others likewise kLeast of the largest. kSkip: nothing.
Matrix7d Repaired(const Matrix7d& information, GraphKind kind, BadInformation how);

constexpr double kLeastEigenvalue = 1e-9;  ///< of the largest one

}  // namespace tutti::internal
