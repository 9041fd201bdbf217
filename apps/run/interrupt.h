// Ctrl-C asks a run to finish its frame and write what it has.
#pragma once

#include <array>
#include <csignal>

namespace tutti {

/// While it lives, the first SIGINT, SIGTERM or SIGQUIT sets a flag; a second one ends the process as usual.
/// SIGHUP (a terminal that is gone; it may come twice), SIGXFSZ (a file grew to the limit; it comes with each
/// write) and SIGXCPU (ulimit -t; it comes each second until the hard limit) set it, too, any number of
/// times. SIGPIPE is ignored: a run outlives the one who reads its messages. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  static bool Requested();

 private:
  static constexpr std::array<int, 7> kSignals = {SIGINT,  SIGTERM, SIGQUIT, SIGHUP,
                                                  SIGXFSZ, SIGXCPU, SIGPIPE};
  std::array<struct sigaction, kSignals.size()> old_ = {};
};

}  // namespace tutti
