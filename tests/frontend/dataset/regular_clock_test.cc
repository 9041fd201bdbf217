#include "frontend/dataset/regular_clock.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace tutti {
namespace {

constexpr double kTick = 1.0 / 30, kFirstTick = 1305031102.1753;

struct TickingClock {
  std::vector<double> times, stamps;
};

// Every 11th image is missing, and once 40 in a row.
TickingClock JitteringClock(double most_s) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> jitter(-most_s, most_s);
  TickingClock clock;
  for (int tick = 0; tick < 400; ++tick) {
    if (tick % 11 == 5 || (tick >= 200 && tick < 240)) continue;
    clock.times.push_back(kFirstTick + tick * kTick);
    clock.stamps.push_back(clock.times.back() + jitter(random));
  }
  return clock;
}

TEST(RegularClock, TakesTheJitterOutOfStampsAcrossGaps) {
  const TickingClock clock = JitteringClock(0.007);
  const std::vector<double> found = RegularTimes(clock.stamps);
  double squares = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_NEAR(found[i], clock.times[i], 0.005) << i;
    squares += std::pow(found[i] - clock.times[i], 2);
  }
  EXPECT_LT(std::sqrt(squares / static_cast<double>(found.size())), 0.0012) << "0.004 in the stamps";
}

TEST(RegularClock, FollowsAClockThatDrifts) {
  std::vector<double> times;
  times.reserve(300);
  for (int k = 0; k < 300; ++k) times.push_back(k * kTick * (1 + 1e-4 * k));
  std::vector<double> stamps = times;
  for (std::size_t k = 0; k < stamps.size(); ++k) stamps[k] += k % 2 == 0 ? 0.004 : -0.004;
  const std::vector<double> found = RegularTimes(stamps);
  for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], times[k], 0.002) << k;
}

TEST(RegularClock, LeavesStampsThatDoNotJitterOrHaveNoClock) {
  const TickingClock even = JitteringClock(0.0001);
  EXPECT_EQ(RegularTimes(even.stamps), even.stamps);
  std::mt19937 random(5);
  std::exponential_distribution<double> wait(30);
  std::vector<double> at_random(1, kFirstTick);
  for (int k = 0; k < 300; ++k) at_random.push_back(at_random.back() + 0.001 + wait(random));
  EXPECT_EQ(RegularTimes(at_random), at_random);
  EXPECT_EQ(RegularTimes({1, 2.1, 2.9}), std::vector<double>({1, 2.1, 2.9})) << "too few";
  EXPECT_TRUE(RegularTimes({}).empty());
  EXPECT_EQ(RegularTimes(std::vector<double>(50, 7.0)), std::vector<double>(50, 7.0));
}

}  // namespace
}  // namespace tutti
