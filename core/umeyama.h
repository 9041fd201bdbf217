// The similarity between two lists of points. Not installed.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "tutti/core/pose.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti::internal {

/// S_a_b that minimises sum ||a - S b||^2 (Umeyama, PAMI 13(4) 1991, eq. 40-43; scale 1 unless `with_scale`).
/// None of fewer than three points, and where they lie on a line or in one place: the rotation is not
/// determined then. The lists are equally long.
std::optional<Similarity> Umeyama(const std::vector<Eigen::Vector3d>& a,
                                  const std::vector<Eigen::Vector3d>& b, bool with_scale);

}  // namespace tutti::internal
#pragma GCC visibility pop
