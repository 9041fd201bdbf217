#include "loopclosure/memory/belief.h"

#include <cstddef>

namespace tutti {

int Belief::Best() const {
  int best = -1;
  double value = 0.0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (places[i] > 0.0 && places[i] >= value) {
      best = static_cast<int>(i);
      value = places[i];
    }
  }
  return best;
}

void Belief::Normalise() {
  double sum = new_place;
  for (const double value : places) sum += value;
  if (!(sum > 0.0)) return;
  new_place /= sum;
  for (double& value : places) value /= sum;
}

}  // namespace tutti
