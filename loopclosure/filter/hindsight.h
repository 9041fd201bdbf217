// What the images after one say of where it was: fixed-lag smoothing of the filter. Internal.
#pragma once

#include <deque>
#include <vector>

#include "core/state_archive.h"
#include "loopclosure/filter/transition_model.h"
#include "loopclosure/memory/belief.h"

namespace tutti::internal {

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

}  // namespace tutti::internal
