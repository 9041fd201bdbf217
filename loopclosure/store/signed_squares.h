// Numbers of -1 to 1 of which each fits a byte: finest next to 0, where most of a descriptor's are.
#pragma once

#include <algorithm>
#include <cmath>

namespace tutti::internal {

inline constexpr int kMostRoot = 127;  ///< of a signed square: the next, 128, would be 1

/// The root of the signed square that is nearest by its root: -kMostRoot .. kMostRoot. `value` is a number.
inline int SignedRoot(float value) {
  const int root = static_cast<int>(std::lround(std::sqrt(std::min(std::abs(value), 1.0f)) * 128));
  return std::copysign(1.0f, value) < 0 ? -std::min(root, kMostRoot) : std::min(root, kMostRoot);
}
inline float SignedSquare(int root) { return static_cast<float>(root * std::abs(root)) / (128 * 128); }

}  // namespace tutti::internal
