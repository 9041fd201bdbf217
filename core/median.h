// The middle of a list. Not installed.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace tutti::internal {

/// The middle one in order of size (of an even number the larger of the two); 0 for none.
template <typename T>
T Median(std::vector<T> values) {
  if (values.empty()) return T(0);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace tutti::internal
