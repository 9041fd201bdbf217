// Time on the clock that never jumps. Not installed.
#pragma once

#include <chrono>
#include <map>
#include <string>

#include "tutti/core/span_recorder.h"

namespace tutti::internal {

/// Seconds since some moment in the past, the same one for the whole process.
inline double SteadySeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Wall time since it was made.
class Stopwatch {
 public:
  double Seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  double Milliseconds() const {
    return std::chrono::duration<double, std::milli>(Clock::now() - start_).count();
  }
  /// Since the last call, or since it was made.
  double LapMs() {
    const auto now = Clock::now();
    const double ms = std::chrono::duration<double, std::milli>(now - lap_).count();
    lap_ = now;
    return ms;
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
  Clock::time_point lap_ = start_;
};

}  // namespace tutti::internal

namespace tutti {

/// Where the time of the odometry goes: sums by stage, and spans if somebody asked for them.
struct StageTimes {
  std::map<std::string, double> milliseconds;  // summed
  SpanRecorder* recorder = nullptr;            // not owned; null: sums alone
};

/// Adds the wall time of a scope to its stage.
class ScopedStopwatch {
 public:
  ScopedStopwatch(StageTimes* times, Lane lane, const char* stage)
      : sum_(&times->milliseconds[stage]), span_(times->recorder, lane, stage) {}
  ~ScopedStopwatch() { *sum_ += watch_.Milliseconds(); }
  ScopedStopwatch(const ScopedStopwatch&) = delete;
  ScopedStopwatch& operator=(const ScopedStopwatch&) = delete;

 private:
  double* sum_;
  ScopedSpan span_;
  internal::Stopwatch watch_;
};

}  // namespace tutti
