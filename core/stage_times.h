// Where the time of the odometry goes: sums by stage, and spans if somebody asked for them.
#pragma once

#include <map>
#include <string>

#include "core/stopwatch.h"
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
