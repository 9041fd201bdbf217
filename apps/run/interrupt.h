// Ctrl-C asks a run to finish its frame and write what it has.
#pragma once

#include <array>
#include <atomic>
#include <csignal>
#include <cstddef>

namespace tutti {

/// While it lives, the first SIGINT, SIGTERM or SIGQUIT sets a flag; a second one ends the process as usual.
/// SIGHUP (a terminal that is gone; it may come twice), SIGXFSZ (a file grew to the limit; it comes with each
/// write) and SIGXCPU (ulimit -t; it comes each second until the hard limit) set it, too, any number of
/// times. SIGPIPE is ignored: a run outlives the one who reads its messages. One at a time.
class InterruptGuard {
 public:
  InterruptGuard() {
    requested_ = false;
    for (std::size_t i = 0; i < kSignals.size(); ++i) {
      const int signal = kSignals[i];
      sigaction(signal, nullptr, &old_[i]);
      if (signal == SIGHUP && old_[i].sa_handler == SIG_IGN) continue;  // nohup
      struct sigaction action = {};
      action.sa_handler = signal == SIGPIPE ? SIG_IGN : [](int) { requested_ = true; };
      // The second one ends the process.
      if (signal == SIGINT || signal == SIGTERM || signal == SIGQUIT)
        action.sa_flags = static_cast<int>(SA_RESETHAND);
      sigemptyset(&action.sa_mask);
      sigaction(signal, &action, nullptr);
    }
  }
  ~InterruptGuard() {
    for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &old_[i], nullptr);
  }
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  static bool Requested() { return requested_; }

 private:
  static constexpr std::array<int, 7> kSignals = {SIGINT,  SIGTERM, SIGQUIT, SIGHUP,
                                                  SIGXFSZ, SIGXCPU, SIGPIPE};
  // A signal handler can reach nothing but a global. Any thread may be the one that is interrupted.
  static inline std::atomic<bool> requested_ = false;
  static_assert(std::atomic<bool>::is_always_lock_free);
  std::array<struct sigaction, kSignals.size()> old_ = {};
};

}  // namespace tutti
