// What is decided of an image some images later. Internal.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "core/state_archive.h"
#include "loopclosure/detector/hypothesis_search.h"
#include "loopclosure/filter/bayes_filter.h"
#include "tutti/loopclosure/detector.h"

namespace tutti::internal {

/// The second word (loop-closure.md section 2): Hindsight::kImages after an image, the posterior that knows
/// the images since is weighed with what geometry found. A loop that was not accepted may be now, and one
/// that was may be withdrawn. Where images before close loops at the place already, and geometry knows the
/// motion, an even chance is enough; where geometry knows no motion, an image since must close a loop there.
class SecondWord {
 public:
  /// A step of the filter at a new location.
  void Step(int slot, const Belief& posterior, const Belief& likelihood) {
    hindsight_.Add(slot, posterior, likelihood);
  }
  /// What was decided at first of the newest location; nothing is kept of one without a step.
  void Keep(int slot, const LoopResult& result);
  /// The next image does not follow those before.
  void Forget();

  /// What changes of the image that it is time for; nothing where all stays as it was.
  std::optional<LateLoop> Say(const LoopDetectorOptions& options, const LocationMemory& memory,
                              const TransitionModel& transition, const HypothesisSearch& search);

  template <class Archive>
  void State(Archive& archive) {
    archive(hindsight_, first_);
  }
  /// Throws InputError unless what was read is of the locations of `memory`.
  void Check(const LocationMemory& memory, const StateReader& in) const;

 private:
  struct First {
    int slot;
    LoopResult result;  // what geometry tried, without matches

    template <class Archive>
    void State(Archive& archive);
  };
  bool StillThere(const std::vector<int>& around, const LocationMemory& memory) const;

  Hindsight hindsight_;
  std::deque<First> first_;  // of images in hindsight_
};

}  // namespace tutti::internal
