#include "apps/run/prefetcher.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "core/stopwatch.h"

namespace tutti {

// A reader must not throw for one bad frame; if it does all the same, the frame counts as bad.
FetchedFrame Prefetcher::Read(std::size_t position) const {
  try {
    FetchedFrame frame;
    frame.position = position;
    const internal::Stopwatch watch;
    {
      const ScopedSpan span(options_.recorder, Lane::kReading, "read");
      frame.read = dataset_.Read(position);
    }
    frame.read_ms = watch.Milliseconds();
    if (frame.read.frame && options_.prepare) options_.prepare(*frame.read.frame);
    frame.prepare_ms = watch.Milliseconds() - frame.read_ms;
    return frame;
  } catch (const std::exception& e) {
    FetchedFrame frame;
    frame.position = position;
    frame.read.error = e.what();
    return frame;
  }
}

Prefetcher::Prefetcher(const Dataset& dataset, PrefetchOptions options)
    : dataset_(dataset), options_(std::move(options)), next_(options_.begin), read_(options_.begin) {
  if (options_.ahead > 0) thread_ = std::thread(&Prefetcher::Work, this);
}

Prefetcher::~Prefetcher() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

bool Prefetcher::Available(std::size_t position) const {
  if (position >= options_.end) return false;
  return dataset_.WaitFor(position, [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    return stop_ || (options_.stop && options_.stop());
  });
}

void Prefetcher::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stop_ || options_.newest || ready_.size() < options_.ahead; });
    if (stop_) return;
    const std::size_t position = read_;
    lock.unlock();
    const bool there = Available(position);
    FetchedFrame frame;
    if (there) frame = Read(position);
    lock.lock();
    if (!there) {
      finished_ = true;
      changed_.notify_all();
      return;
    }
    if (position >= next_) {  // not skipped meanwhile
      if (ready_.size() >= options_.ahead) ready_.pop_front();
      ready_.push_back(std::move(frame));
    }
    read_ = std::max(read_, position + 1);
    changed_.notify_all();
  }
}

std::optional<FetchedFrame> Prefetcher::Next() {
  const internal::Stopwatch watch;
  std::optional<FetchedFrame> frame;
  if (options_.ahead == 0) {
    if (Available(next_)) frame = Read(next_);
    ++next_;
  } else {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return finished_ || !ready_.empty(); });
    if (!ready_.empty()) {
      frame = std::move(ready_.front());
      ready_.pop_front();
      next_ = frame->position + 1;
    }
    changed_.notify_all();
  }
  waited_ms_ += watch.Milliseconds();
  return frame;
}

void Prefetcher::SkipTo(std::size_t position) {
  const std::lock_guard<std::mutex> lock(mutex_);
  next_ = std::max(next_, position);
  read_ = std::max(read_, next_);
  while (!ready_.empty() && ready_.front().position < next_) ready_.pop_front();
  changed_.notify_all();
}

}  // namespace tutti
