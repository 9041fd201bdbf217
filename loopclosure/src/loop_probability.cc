#include "loop_probability.h"

#include <algorithm>
#include <cmath>

namespace tutti::internal {

double LoopProbability(const Verification& verification) {
  const double mass = std::clamp(verification.mass, 1e-4, 1.0 - 1e-4);
  const double sure = std::log(1.0 - std::min(0.0, verification.log_nfa));
  const double apart = std::log(verification.motion_spread + 1e-3);
  const double logit = -2.385 + 0.796 * std::log(mass / (1.0 - mass)) + 1.318 * sure - 0.169 * apart;
  return 1.0 / (1.0 + std::exp(-logit));
}

}  // namespace tutti::internal
