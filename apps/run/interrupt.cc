#include "apps/run/interrupt.h"

namespace tutti {
namespace {

// A signal handler can reach nothing but a global.
volatile std::sig_atomic_t requested = 0;

extern "C" void OnSignal(int) { requested = 1; }

}  // namespace

InterruptGuard::InterruptGuard() {
  requested = 0;
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    const int signal = kSignals[i];
    sigaction(signal, nullptr, &old_[i]);
    if (signal == SIGHUP && old_[i].sa_handler == SIG_IGN) continue;  // nohup
    struct sigaction action = {};
    action.sa_handler = signal == SIGPIPE ? SIG_IGN : OnSignal;
    // The second one ends the process.
    if (signal == SIGINT || signal == SIGTERM) action.sa_flags = static_cast<int>(SA_RESETHAND);
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, nullptr);
  }
}

InterruptGuard::~InterruptGuard() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &old_[i], nullptr);
}

bool InterruptGuard::Requested() { return requested != 0; }

}  // namespace tutti
