// Which signals ask a run to end, and which end the process.
#include "apps/run/interrupt.h"

#include <gtest/gtest.h>

namespace tutti {
namespace {

// Whether or not the tests run under nohup.
class InterruptGuardTest : public ::testing::Test {
 protected:
  InterruptGuardTest() : before_(std::signal(SIGHUP, SIG_DFL)) {}
  ~InterruptGuardTest() override { std::signal(SIGHUP, before_); }

 private:
  void (*before_)(int);
};

TEST_F(InterruptGuardTest, EachSignalThatEndsARunSetsTheFlag) {
  for (const int signal : {SIGINT, SIGTERM, SIGQUIT, SIGHUP, SIGXFSZ, SIGXCPU}) {
    const InterruptGuard guard;
    EXPECT_FALSE(InterruptGuard::Requested());
    std::raise(signal);
    EXPECT_TRUE(InterruptGuard::Requested()) << signal;
  }
}

TEST_F(InterruptGuardTest, ATerminalThatIsGoneSaysSoMoreThanOnce) {
  const InterruptGuard guard;
  for (const int signal : {SIGHUP, SIGHUP, SIGXFSZ, SIGXFSZ, SIGXCPU, SIGXCPU, SIGPIPE}) std::raise(signal);
  EXPECT_TRUE(InterruptGuard::Requested());
}

TEST_F(InterruptGuardTest, NohupStays) {
  std::signal(SIGHUP, SIG_IGN);
  const InterruptGuard guard;
  std::raise(SIGHUP);
  EXPECT_FALSE(InterruptGuard::Requested());
}

TEST(InterruptGuardDeathTest, ASecondCtrlCEndsTheProcess) {
  const auto twice = [](int signal) {
    const InterruptGuard guard;
    std::raise(signal);
    std::raise(signal);
  };
  EXPECT_EXIT(twice(SIGINT), ::testing::KilledBySignal(SIGINT), "");
  EXPECT_EXIT(twice(SIGQUIT), ::testing::KilledBySignal(SIGQUIT), "");
}

}  // namespace
}  // namespace tutti
