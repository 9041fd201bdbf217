// Work on several threads, and where its time goes.
#include "core/parallel.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <ctime>
#include <exception>
#include <system_error>
#include <thread>
#include <vector>

#include "tutti/core/span_recorder.h"

namespace tutti {

void RunParallel(int count, int threads, const std::function<void(int)>& task) {
  if (threads <= 1 || count <= 1) {
    for (int i = 0; i < count; ++i) task(i);
    return;
  }
  std::atomic<int> next{0};
  std::vector<std::exception_ptr> errors(static_cast<std::size_t>(count));
  const auto work = [&] {
    for (int i = next++; i < count; i = next++) {
      try {
        task(i);
      } catch (...) {
        errors[static_cast<std::size_t>(i)] = std::current_exception();
      }
    }
  };
  std::vector<std::thread> helpers;
  try {
    for (int t = 1; t < std::min(threads, count); ++t) helpers.emplace_back(work);
  } catch (const std::system_error&) {  // no memory for one more: those that are there do its part
  }
  work();
  for (std::thread& helper : helpers) helper.join();
  for (const std::exception_ptr& error : errors) {
    if (error) std::rethrow_exception(error);
  }
}

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
