#include "apps/run/odometry_alone.h"

#include "tutti/core/span_recorder.h"

namespace tutti {

// Mapping stays on the thread that tracks: its time is what this costs.
OdometryAlone::OdometryAlone(const Odometry& odometry, std::int64_t last, bool own_thread)
    : odometry_(odometry, Execution{false, nullptr}), last_(last) {
  if (own_thread) thread_ = std::thread(&OdometryAlone::Work, this);
}

OdometryAlone::~OdometryAlone() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void OdometryAlone::Track(const InputFrame& frame) {
  if (frame.index <= last_) return;
  last_ = frame.index;
  if (!thread_.joinable()) {
    Do(frame);
    return;
  }
  Wait(kMostWaiting - 1);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    waiting_.push_back(frame);
  }
  changed_.notify_all();
}

const Odometry& OdometryAlone::Tracked() {
  Wait(0);
  return odometry_;
}

void OdometryAlone::Finish() {
  Wait(0);
  odometry_.FinishMapping();
}

double OdometryAlone::CpuSeconds() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return cpu_s_;
}

// Until no more than so many frames wait.
void OdometryAlone::Wait(std::size_t most) {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [&] { return waiting_.size() <= most || failure_; });
  if (failure_) std::rethrow_exception(failure_);
}

void OdometryAlone::Do(const InputFrame& frame) {
  const double begin = ThreadCpuMilliseconds();
  odometry_.Track(frame);
  const double spent = ThreadCpuMilliseconds() - begin;
  const std::lock_guard<std::mutex> lock(mutex_);
  cpu_s_ += 1e-3 * spent;
}

void OdometryAlone::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stop_ || !waiting_.empty(); });
    if (stop_) return;
    const InputFrame frame = waiting_.front();
    lock.unlock();
    std::exception_ptr failure;
    try {
      Do(frame);
    } catch (...) {
      failure = std::current_exception();
    }
    lock.lock();
    waiting_.pop_front();
    failure_ = failure;
    changed_.notify_all();
    if (failure_) return;
  }
}

}  // namespace tutti
