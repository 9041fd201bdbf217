// RANSAC with a truncated-squares score (MSAC, Torr & Zisserman 2000) and a generator of its own. Internal.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace tutti::internal {

struct RansacSettings {
  int sample_size = 3;
  int max_iterations = 1000;
  double confidence = 0.9999;
  std::uint64_t seed = 1;
};

/// `fit(sample)` gives the models through the sampled indices; `error(model, i)` the squared error of datum i
/// relative to the squared threshold (1 = at the threshold; infinity where impossible). Returns the inliers
/// of the best model and sets `best`. Deterministic for a seed: the generator is local and the draws do not
/// depend on the standard library.
template <typename Model, typename Fit, typename Error>
std::vector<int> Ransac(int count, const RansacSettings& settings, const Fit& fit, const Error& error,
                        Model& best) {
  std::vector<int> best_inliers;
  if (count < settings.sample_size) return best_inliers;
  std::mt19937_64 generator(settings.seed);
  double best_cost = static_cast<double>(count);
  int needed = settings.max_iterations;
  std::vector<int> sample;
  for (int iteration = 0; iteration < needed; ++iteration) {
    sample.clear();
    while (static_cast<int>(sample.size()) < settings.sample_size) {
      const int i = static_cast<int>(generator() % static_cast<std::uint64_t>(count));
      if (std::find(sample.begin(), sample.end(), i) == sample.end()) sample.push_back(i);
    }
    for (const Model& model : fit(sample)) {
      double cost = 0.0;
      for (int i = 0; i < count && cost < best_cost; ++i) cost += std::min(1.0, error(model, i));
      if (!(cost < best_cost)) continue;
      best_cost = cost;
      best = model;
      best_inliers.clear();
      for (int i = 0; i < count; ++i) {
        if (error(model, i) < 1.0) best_inliers.push_back(i);
      }
      const double share = static_cast<double>(best_inliers.size()) / count;
      const double miss = 1.0 - std::pow(share, settings.sample_size);
      if (miss <= 0.0) return best_inliers;
      const double wanted = std::ceil(std::log(1.0 - settings.confidence) / std::log(miss));
      needed = static_cast<int>(std::min<double>(settings.max_iterations, std::max(20.0, wanted)));
    }
  }
  return best_inliers;
}

}  // namespace tutti::internal
