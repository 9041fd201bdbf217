// A DetectorState that is shown the walk of two_laps.h, without a filter and without geometry.
#pragma once

#include <utility>

#include "loopclosure/detector/detector_state.h"
#include "tests/loopclosure/detector/two_laps.h"
#include "tutti/core/error.h"

namespace tutti::testing {

/// One member with few features, whose locations leave short-term memory at once.
inline LoopDetectorOptions OneMember() {
  LoopDetectorOptions options = SmallOptions();
  options.members = {"orb"};
  options.rule = CombinationRule::kSingle;
  options.stm_size = 1;
  options.threads = 1;
  return options;
}

/// Shows it a query; returns the view that geometry would get.
inline const View& Show(internal::DetectorState& state, const LoopQuery& query) {
  const std::vector<Features> features = state.ensemble().Extract(query);
  View view = MakeView(query, features, state.options().verification);
  const std::vector<SeenWords> words = state.ensemble().Quantise(features, view.size);
  return state.Remember(query, std::move(view), words);
}

/// Shows it the images begin .. end - 1 of a walk past so many places that none comes twice.
inline void Show(internal::DetectorState& state, int begin, int end) {
  for (int i = begin; i < end; ++i) Show(state, Query(i, WalkImage(i, 100)));
}

/// The message that a call fails with; empty if it does not.
template <typename Call>
std::string RefusalOf(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

}  // namespace tutti::testing
