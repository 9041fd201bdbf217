// Which signals ask a run to end, and which end the process.
#include "apps/run/interrupt.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

TEST(InterruptGuard, EachSignalThatEndsARunSetsTheFlag) {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGXFSZ}) {
    const InterruptGuard guard;
    EXPECT_FALSE(InterruptGuard::Requested());
    std::raise(signal);
    EXPECT_TRUE(InterruptGuard::Requested()) << signal;
  }
}

TEST(InterruptGuard, ATerminalThatIsGoneSaysSoMoreThanOnce) {
  const InterruptGuard guard;
  for (const int signal : {SIGHUP, SIGHUP, SIGXFSZ, SIGXFSZ, SIGPIPE}) std::raise(signal);
  EXPECT_TRUE(InterruptGuard::Requested());
}

TEST(InterruptGuard, NohupStays) {
  const auto before = std::signal(SIGHUP, SIG_IGN);
  {
    const InterruptGuard guard;
    std::raise(SIGHUP);
    EXPECT_FALSE(InterruptGuard::Requested());
  }
  std::signal(SIGHUP, before);
}

TEST(InterruptGuardDeathTest, ASecondCtrlCEndsTheProcess) {
  const auto twice = [] {
    const InterruptGuard guard;
    std::raise(SIGINT);
    std::raise(SIGINT);
  };
  EXPECT_EXIT(twice(), ::testing::KilledBySignal(SIGINT), "");
}

}  // namespace
}  // namespace tutti
