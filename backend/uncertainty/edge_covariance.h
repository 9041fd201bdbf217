// Covariances of relative poses as perturbations T Exp(d), d = (translation, rotation vector). Private to the
// back end.
#pragma once

#include <vector>

#include "tutti/backend/pose_graph.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::internal {

/// Inverse of an edge's information, 6x6 [m^2, m rad, rad^2]; what SE(2) does not use is zero. With kChi2 the
/// information of a 3D edge is of the quaternion's vector part, half of the rotation vector.
Matrix6d EdgeCovariance(const PoseGraphEdge& edge, GraphKind kind, GraphObjective objective);

/// The covariance of a perturbation of frame b, expressed in frame a: Ad(T_a_b) C Ad(T_a_b)^T.
Matrix6d Transported(const Matrix6d& covariance, const Pose& T_a_b);

/// d^T C^-1 d over the coordinates that the kind uses; infinite if C is singular there.
double Mahalanobis(const Vector6d& d, const Matrix6d& covariance, GraphKind kind);

}  // namespace tutti::internal
