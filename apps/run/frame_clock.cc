#include "apps/run/frame_clock.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>
#include <utility>

#include "core/numbers.h"
#include "core/stopwatch.h"

namespace tutti {

double FrameClock::Now() { return internal::SteadySeconds(); }

void FrameClock::WaitUntil(double now) {
  for (double left = now - Now(); left > 0; left = now - Now()) {
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(left, 0.1)));
  }
}

void Playback::Reach(double stamp_s) {
  if (offset_s_) {
    clock_->WaitUntil(stamp_s + *offset_s_);
  } else {
    offset_s_ = clock_->Now() - stamp_s;
  }
}

std::optional<std::string> StampPauses::Next(std::int64_t frame, double stamp_s) {
  constexpr double kLeast_s = 10, kTimesTheUsual = 20;
  constexpr std::size_t kRemembered = 31;  // frames
  const std::optional<double> before = std::exchange(before_s_, stamp_s);
  if (!before) return std::nullopt;
  const double interval = stamp_s - *before;
  const bool pause = !intervals_s_.empty() && interval > kLeast_s &&
                     interval > kTimesTheUsual * internal::Median(intervals_s_);
  if (intervals_s_.size() < kRemembered) {
    intervals_s_.push_back(interval);
  } else {
    intervals_s_[std::exchange(oldest_, (oldest_ + 1) % kRemembered)] = interval;
  }
  if (!pause) return std::nullopt;
  return "frame " + std::to_string(frame) + " comes " + std::to_string(std::llround(interval)) +
         " s after the one before it: of the motion between them nothing is known. Did the camera stop, or "
         "was its clock set?";
}

}  // namespace tutti
