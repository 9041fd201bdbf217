#include "loopclosure/filter/bayes_filter.h"

#include <algorithm>
#include <cmath>

#include "core/numbers.h"

namespace tutti {

void BayesFilter::Step(const TransitionModel& transition, const std::vector<int>& working_memory,
                       const Belief& likelihood) {
  posterior_.places.resize(likelihood.places.size(), 0.0);
  if (!started_) {
    const double uniform = 1.0 / (static_cast<double>(working_memory.size()) + 1.0);
    posterior_.new_place = uniform;
    for (const int slot : working_memory) posterior_.places[internal::Index(slot)] = uniform;
    started_ = true;
  }
  posterior_ = transition.Predict(posterior_, working_memory);
  posterior_.new_place *= likelihood.new_place;
  for (const int slot : working_memory) {
    const std::size_t i = internal::Index(slot);
    posterior_.places[i] *= likelihood.places[i];
  }
  posterior_.Normalise();
}

void BayesFilter::Forget(int slot) {
  const std::size_t i = internal::Index(slot);
  if (i < posterior_.places.size()) posterior_.places[i] = 0.0;
}

namespace internal {

void Hindsight::Add(int slot, const Belief& posterior, const Belief& likelihood) {
  steps_.push_back({slot, posterior, likelihood});
  if (steps_.size() > kImages + 1) steps_.pop_front();
}

Belief Hindsight::Smoothed(const TransitionModel& transition, const std::vector<int>& working_memory) const {
  Belief beta;
  beta.places.assign(steps_.back().posterior.places.size(), 1.0);
  for (auto step = steps_.rbegin(); std::next(step) != steps_.rend(); ++step) {
    beta.new_place *= step->likelihood.new_place;
    double most = beta.new_place;
    for (const int slot : working_memory) {
      const std::size_t i = internal::Index(slot);
      // What was not in working memory then could not be said to be there.
      beta.places[i] *= i < step->likelihood.places.size() ? step->likelihood.places[i] : 0.0;
      most = std::max(most, beta.places[i]);
    }
    if (!(most > 0.0)) break;
    beta.new_place /= most;
    for (const int slot : working_memory) beta.places[internal::Index(slot)] /= most;
    beta = transition.Backward(beta, working_memory);
  }
  Belief gamma;
  const Belief& alpha = steps_.front().posterior;
  gamma.places.assign(beta.places.size(), 0.0);
  gamma.new_place = alpha.new_place * beta.new_place;
  for (const int slot : working_memory) {
    const std::size_t i = internal::Index(slot);
    if (i < alpha.places.size()) gamma.places[i] = alpha.places[i] * beta.places[i];
  }
  gamma.Normalise();
  return gamma;
}

void Hindsight::Check(int end, const StateReader& in) const {
  if (steps_.size() > kImages + 1) in.Damaged("more steps of a filter than are kept");
  const auto good = [](double value) { return value >= 0.0 && std::isfinite(value); };
  for (const Step& step : steps_) {
    in.Check(step.slot, 0, end, "a step of a filter at an unknown location");
    for (const Belief* belief : {&step.posterior, &step.likelihood}) {
      if (!good(belief->new_place) || belief->places.size() > internal::Index(end) ||
          !std::all_of(belief->places.begin(), belief->places.end(), good)) {
        in.Damaged("a step of a filter that is no belief");
      }
    }
  }
}

}  // namespace internal
}  // namespace tutti
