// Degrees, indices and medians: what all modules count with. Not installed.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tutti::internal {

constexpr double kDegrees = 57.29577951308232;     ///< in a radian
constexpr double kRadians = 0.017453292519943295;  ///< in a degree

/// Slots, rows and members are counted by int; containers want std::size_t.
inline std::size_t Index(int i) { return static_cast<std::size_t>(i); }

/// The middle one in order of size (of an even number the larger of the two); 0 for none.
template <typename T>
T Median(std::vector<T> values) {
  if (values.empty()) return T(0);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace tutti::internal
