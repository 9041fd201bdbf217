#include "tutti/core/span_recorder.h"

#include <ctime>

namespace tutti {

const char* ToString(Lane lane) {
  switch (lane) {
    case Lane::kReading:
      return "reading";
    case Lane::kTracking:
      return "tracking";
    case Lane::kMapping:
      return "mapping";
    case Lane::kLoopClosure:
      return "loop closure";
    case Lane::kOptimisation:
      return "optimisation";
  }
  return "?";
}

void SpanRecorder::Add(Span span) {
  const std::lock_guard<std::mutex> lock(mutex_);
  spans_.push_back(std::move(span));
}

std::vector<Span> SpanRecorder::Spans() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return spans_;
}

double ThreadCpuMilliseconds() {
  timespec now = {};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

}  // namespace tutti
