// What closed loops ask of the odometry's map.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "tutti/frontend/odometry.h"

namespace tutti {

/// What LoopCloser wants done; empty: nothing.
struct LoopUpdate {
  std::optional<MapCorrection> correction;
  std::vector<std::size_t> fused;    ///< records of the loops in MapCorrection::fused
  std::vector<std::size_t> revoked;  ///< records of loops that the detector is to forget
};

}  // namespace tutti
