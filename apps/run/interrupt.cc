#include "apps/run/interrupt.h"

#include <atomic>

namespace tutti {
namespace {

// A signal handler can reach nothing but a global. Any thread may be the one that is interrupted.
std::atomic<bool> requested = false;
static_assert(std::atomic<bool>::is_always_lock_free);

extern "C" void OnSignal(int) { requested = true; }

}  // namespace

InterruptGuard::InterruptGuard() {
  requested = false;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    const int signal = kSignals[i];
    sigaction(signal, nullptr, &old_[i]);
    if (signal == SIGHUP && old_[i].sa_handler == SIG_IGN) continue;  // nohup
    struct sigaction action = {};
    action.sa_handler = signal == SIGPIPE ? SIG_IGN : OnSignal;
    // The second one ends the process.
    if (signal == SIGINT || signal == SIGTERM || signal == SIGQUIT)
      action.sa_flags = static_cast<int>(SA_RESETHAND);
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, nullptr);
  }
}

InterruptGuard::~InterruptGuard() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &old_[i], nullptr);
}

bool InterruptGuard::Requested() { return requested; }

}  // namespace tutti
