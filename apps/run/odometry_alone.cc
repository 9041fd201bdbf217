#include "apps/run/odometry_alone.h"

#include <chrono>
#include <utility>

#include "tutti/core/span_recorder.h"

namespace tutti {

// Mapping stays on the thread that tracks: its time is what this costs.
OdometryAlone::OdometryAlone(const Odometry& odometry, std::int64_t last, bool own_thread)
    : odometry_(odometry, Execution{false, nullptr}), last_(last), own_thread_(own_thread) {}

// What waits is not tracked any more.
OdometryAlone::~OdometryAlone() { stop_ = true; }

void OdometryAlone::Track(const InputFrame& frame) {
  if (frame.index <= last_) return;
  last_ = frame.index;
  if (!own_thread_) return Do(frame);
  Wait(kMostWaiting - 1);
  std::shared_future<void> before;
  if (!waiting_.empty()) before = waiting_.back();
  const auto work = [this, frame, before = std::move(before)]() mutable {
    if (before.valid()) std::exchange(before, {}).get();  // or each would keep all before it
    if (!stop_) Do(frame);
  };
  waiting_.push_back(std::async(std::launch::async, work).share());
}

void OdometryAlone::Finish() {
  Wait(0);
  odometry_.FinishMapping();
}

void OdometryAlone::Wait(std::size_t most) {
  const auto done = [](const std::shared_future<void>& tracked) {
    return tracked.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
  };
  while (!waiting_.empty() && (waiting_.size() > most || done(waiting_.front()))) {
    const std::shared_future<void> first = std::move(waiting_.front());
    waiting_.pop_front();
    first.get();
  }
}

void OdometryAlone::Do(const InputFrame& frame) {
  const double begin = ThreadCpuMilliseconds();
  odometry_.Track(frame);
  cpu_s_ = cpu_s_ + 1e-3 * (ThreadCpuMilliseconds() - begin);
}

}  // namespace tutti
