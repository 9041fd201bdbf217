#include "loopclosure/filter/loop_probability.h"

#include <algorithm>
#include <cmath>

namespace tutti::internal {

double LoopProbability(const Verification& verification) {
  const double mass = std::clamp(verification.mass, 1e-4, 1.0 - 1e-4);
  const double sure = std::clamp(-verification.log_nfa, 0.0, 300.0) / 100.0;
  const double logit = 3.345 + 1.379 * std::log(mass / (1.0 - mass)) + 0.889 * sure;
  return 1.0 / (1.0 + std::exp(-logit));
}

}  // namespace tutti::internal
