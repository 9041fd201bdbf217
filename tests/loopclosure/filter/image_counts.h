// Counts of images by place, for tests of what learns from them.
#pragma once

#include <numeric>
#include <random>
#include <vector>

namespace tutti::testing {

inline std::vector<int> Places(int n) {
  std::vector<int> places(static_cast<std::size_t>(n));
  std::iota(places.begin(), places.end(), 0);
  return places;
}

// Counts of images that show nothing known: at most `most`.
inline std::vector<double> Resemblances(int n, double most, std::mt19937& random) {
  std::uniform_real_distribution<double> uniform(0.0, most);
  std::vector<double> counts(static_cast<std::size_t>(n));
  for (double& count : counts) count = uniform(random);
  return counts;
}

}  // namespace tutti::testing
