#include "apps/run/frame_clock.h"

#include <algorithm>
#include <chrono>
#include <thread>

#include "core/stopwatch.h"

namespace tutti {

double SteadyFrameClock::Now() { return internal::SteadySeconds(); }

void SteadyFrameClock::WaitUntil(double now) {
  for (double left = now - Now(); left > 0; left = now - Now()) {
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(left, 0.1)));
  }
}

void Playback::Reach(double stamp_s) {
  if (!started_) {
    offset_s_ = clock_.Now() - stamp_s;
    started_ = true;
    return;
  }
  clock_.WaitUntil(stamp_s + offset_s_);
}

bool Playback::Due(double stamp_s) { return started_ && clock_.Now() >= stamp_s + offset_s_; }

}  // namespace tutti
