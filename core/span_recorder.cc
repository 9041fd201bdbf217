#include "tutti/core/span_recorder.h"

#include <array>
#include <ctime>

namespace tutti {

const char* ToString(Lane lane) {
  static constexpr std::array<const char*, kLanes> kNames = {"reading", "tracking", "mapping", "loop closure",
                                                             "optimisation"};
  return kNames.at(static_cast<std::size_t>(lane));
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
