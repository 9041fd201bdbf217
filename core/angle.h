// Degrees and radians. Not installed.
#pragma once

namespace tutti::internal {

constexpr double kDegrees = 57.29577951308232;     ///< in a radian
constexpr double kRadians = 0.017453292519943295;  ///< in a degree

}  // namespace tutti::internal
