// A number for every location and one for "new place": a posterior, a prediction or a likelihood.
#pragma once

#include <cstddef>
#include <vector>

#include "core/numbers.h"

namespace tutti {

/// Over the virtual place (S = -1, "new place") and all slots; slots that are not in working memory hold 0.
struct Belief {
  double new_place = 1.0;      ///< of the virtual place
  std::vector<double> places;  ///< by slot

  /// H = 1 - p(new place): the sum over all real places (loop-closure.md section 2), if this is a posterior.
  double Hypothesis() const { return places.empty() ? 0.0 : 1.0 - new_place; }
  /// Slot of the largest value, the newest of equal ones; -1 if no slot is above 0.
  int Best() const {
    int best = -1;
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (places[i] > 0.0 && (best < 0 || places[i] >= places[internal::Index(best)]))
        best = static_cast<int>(i);
    }
    return best;
  }
  /// Scales so that all sum to 1; leaves an all-zero belief alone.
  void Normalise() {
    double sum = new_place;
    for (const double value : places) sum += value;
    if (!(sum > 0.0)) return;
    new_place /= sum;
    for (double& value : places) value /= sum;
  }

  template <class Archive>
  void State(Archive& archive) {
    archive(new_place, places);
  }
};

}  // namespace tutti
