// Ctrl-C asks a run to finish its frame and write what it has.
#pragma once

#include <csignal>

namespace tutti {

/// While it lives, the first SIGINT or SIGTERM sets a flag; a second one ends the process as usual. One at a
/// time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  static bool Requested();

 private:
  struct sigaction old_interrupt_ = {};
  struct sigaction old_terminate_ = {};
};

}  // namespace tutti
