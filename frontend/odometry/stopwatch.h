// Where the time of the odometry goes: sums by stage, and spans if somebody asked for them.
#pragma once

#include <chrono>
#include <map>
#include <string>

#include "tutti/core/span_recorder.h"

namespace tutti {

struct StageTimes {
  std::map<std::string, double> milliseconds;  // summed
  SpanRecorder* recorder = nullptr;            // not owned; null: sums alone
};

/// Adds the wall time of a scope to its stage.
class ScopedStopwatch {
 public:
  ScopedStopwatch(StageTimes* times, Lane lane, const char* stage)
      : sum_(&times->milliseconds[stage]),
        span_(times->recorder, lane, stage),
        start_(std::chrono::steady_clock::now()) {}
  ~ScopedStopwatch() {
    *sum_ += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
  }
  ScopedStopwatch(const ScopedStopwatch&) = delete;
  ScopedStopwatch& operator=(const ScopedStopwatch&) = delete;

 private:
  double* sum_;
  ScopedSpan span_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace tutti
