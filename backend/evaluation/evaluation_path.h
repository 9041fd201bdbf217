// Length of a path.
#pragma once

#include <vector>

namespace tutti {

/// Distance along the path from the first pose to each [m]. `T` has a member `translation`.
template <typename T>
std::vector<double> PathLengths(const std::vector<T>& poses) {
  std::vector<double> out;
  out.reserve(poses.size());
  for (std::size_t k = 0; k < poses.size(); ++k) {
    out.push_back(k == 0 ? 0.0 : out.back() + (poses[k].translation - poses[k - 1].translation).norm());
  }
  return out;
}

}  // namespace tutti
