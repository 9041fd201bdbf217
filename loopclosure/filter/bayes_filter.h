// The recursive Bayes filter of one member, and what the images after one say of where it was.
#pragma once

#include <algorithm>
#include <deque>
#include <vector>

#include "core/state_archive.h"
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

namespace internal {

/// The last few steps of a Bayes filter. With posterior alpha and likelihoods L (loop-closure.md section 2,
/// "The second word"; Rabiner, Proc. IEEE 77, 1989, for the recursion):
///   beta_t = 1,  beta_s(j) = sum_i p(i | j) L_{s+1}(i) beta_{s+1}(i),  gamma_s ~ alpha_s beta_s.
class Hindsight {
 public:
  static constexpr int kImages = 5;  ///< after an image, before its second word: lambda

  /// A step of the filter at the location `slot`.
  void Add(int slot, const Belief& posterior, const Belief& likelihood);
  /// The images so far say nothing of those to come.
  void Forget() { steps_.clear(); }

  /// The location of the newest step; -1: there is none.
  int Newest() const { return steps_.empty() ? -1 : steps_.back().slot; }
  /// The location that kImages steps have followed; -1: there is none yet.
  int Slot() const { return steps_.size() > kImages ? steps_.front().slot : -1; }
  /// gamma of that location, over the places of working memory; those that came into it since have 0.
  Belief Smoothed(const TransitionModel& transition, const std::vector<int>& working_memory) const;

  template <class Archive>
  void State(Archive& archive) {
    archive(steps_);
  }
  /// Throws InputError unless what was read is of locations before `end`.
  void Check(int end, const StateReader& in) const;

 private:
  struct Step {
    int slot;
    Belief posterior, likelihood;

    template <class Archive>
    void State(Archive& archive) {
      archive(slot, posterior, likelihood);
    }
  };
  std::deque<Step> steps_;
};

}  // namespace internal
}  // namespace tutti
