#include "loopclosure/filter/bayes_filter.h"

namespace tutti {

void BayesFilter::Step(const TransitionModel& transition, const std::vector<int>& working_memory,
                       const Belief& likelihood) {
  posterior_.places.resize(likelihood.places.size(), 0.0);
  if (!started_) {
    const double uniform = 1.0 / (static_cast<double>(working_memory.size()) + 1.0);
    posterior_.new_place = uniform;
    for (const int slot : working_memory) posterior_.places[static_cast<std::size_t>(slot)] = uniform;
    started_ = true;
  }
  posterior_ = transition.Predict(posterior_, working_memory);
  posterior_.new_place *= likelihood.new_place;
  for (const int slot : working_memory) {
    const std::size_t i = static_cast<std::size_t>(slot);
    posterior_.places[i] *= likelihood.places[i];
  }
  posterior_.Normalise();
}

void BayesFilter::Forget(int slot) {
  const std::size_t i = static_cast<std::size_t>(slot);
  if (i < posterior_.places.size()) posterior_.places[i] = 0.0;
}

}  // namespace tutti
