// Wall time of the parts of one image.
#pragma once

#include <chrono>

namespace tutti::internal {

class Stopwatch {
 public:
  /// Since the last call, or since the beginning.
  double LapMs() {
    const auto now = Clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - lap_).count();
    lap_ = now;
    return ms;
  }
  double TotalMs() const { return std::chrono::duration<double, std::milli>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
  Clock::time_point lap_ = start_;
};

}  // namespace tutti::internal
