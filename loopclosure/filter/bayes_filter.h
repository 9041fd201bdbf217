// The recursive Bayes filter of one member.
#pragma once

#include <algorithm>
#include <vector>

#include "loopclosure/filter/transition_model.h"
#include "loopclosure/memory/belief.h"

namespace tutti {

/// p(S_t | L^t) = eta p(L_t | S_t) sum_i p(S_t | S_{t-1} = i) p(S_{t-1} = i | L^{t-1})    (loop-closure.md
/// eq. 1)
///
/// The first step starts from a uniform belief; a location that is new in working memory enters with 0. An
/// image with a bad signature does not call Step at all.
class BayesFilter {
 public:
  /// One step: prediction over `working_memory`, times `likelihood`, normalised.
  void Step(const TransitionModel& transition, const std::vector<int>& working_memory,
            const Belief& likelihood);

  /// A location has left working memory: should it come back, it starts with 0.
  void Forget(int slot);

  /// p(S_t | L^t) after the last step; all mass on "new place" before the first.
  const Belief& posterior() const { return posterior_; }

  template <class Archive>
  void State(Archive& archive) {
    archive(started_, posterior_);
    if constexpr (Archive::kReading) {
      const auto is_probability = [](double p) { return p >= 0.0 && p <= 1.0 + 1e-9; };
      if (!is_probability(posterior_.new_place) ||
          !std::all_of(posterior_.places.begin(), posterior_.places.end(), is_probability))
        archive.Damaged("a posterior that is no probability");
    }
  }

 private:
  Belief posterior_;
  bool started_ = false;
};

}  // namespace tutti
