#include "loop_probability.h"

#include <gtest/gtest.h>

namespace tutti::internal {
namespace {

Verification Seen(double mass, double log_nfa, double motion_spread) {
  Verification verification;
  verification.mass = mass;
  verification.log_nfa = log_nfa;
  verification.motion_spread = motion_spread;
  return verification;
}

TEST(LoopProbability, GrowsWithBeliefAndWithWhatChanceCannotExplain) {
  EXPECT_LT(LoopProbability(Seen(0.2, -50, 0.03)), LoopProbability(Seen(0.9, -50, 0.03)));
  EXPECT_LT(LoopProbability(Seen(0.5, -10, 0.03)), LoopProbability(Seen(0.5, -100, 0.03)));
  EXPECT_GT(LoopProbability(Seen(0.5, -50, 0.01)), LoopProbability(Seen(0.5, -50, 0.2)));
}

TEST(LoopProbability, NeedsBeliefAndGeometry) {
  const double threshold = LoopDetectorOptions().loop_threshold;
  EXPECT_GT(LoopProbability(Seen(0.95, -80, 0.03)), threshold);
  EXPECT_LT(LoopProbability(Seen(0.9, 0, 0.03)), 0.6);    // sure of the place, and nothing to see of it
  EXPECT_LT(LoopProbability(Seen(0.0, -80, 0.03)), 0.9);  // a poster that hangs somewhere else, too
}

TEST(LoopProbability, IsAProbabilityForAnyInput) {
  for (const double mass : {0.0, 1.0}) {
    for (const double nfa : {-1e6, 0.0, 50.0}) {
      for (const double spread : {0.0, 10.0}) {
        const double p = LoopProbability(Seen(mass, nfa, spread));
        EXPECT_GT(p, 0.0);
        EXPECT_LT(p, 1.0 + 1e-12);
      }
    }
  }
}

}  // namespace
}  // namespace tutti::internal
