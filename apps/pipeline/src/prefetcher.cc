#include "prefetcher.h"

#include <chrono>
#include <exception>
#include <utility>

namespace tutti {
// A reader must not throw for one bad frame; if it does all the same, the frame counts as bad.
ReadResult Prefetcher::Read(std::size_t index) const {
  const ScopedSpan span(recorder_, Lane::kReading, "read");
  try {
    return dataset_.Read(index);
  } catch (const std::exception& e) {
    ReadResult result;
    result.error = e.what();
    return result;
  }
}

Prefetcher::Prefetcher(const Dataset& dataset, std::size_t begin, std::size_t end, std::size_t ahead,
                       SpanRecorder* recorder)
    : dataset_(dataset), recorder_(recorder), next_(begin), end_(end), ahead_(ahead), read_(begin) {
  if (ahead_ > 0) thread_ = std::thread(&Prefetcher::Work, this);
}

Prefetcher::~Prefetcher() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void Prefetcher::Work() {
  for (; read_ < end_; ++read_) {
    {
      std::unique_lock<std::mutex> lock(mutex_);
      changed_.wait(lock, [this] { return stop_ || ready_.size() < ahead_; });
      if (stop_) return;
    }
    ReadResult result = Read(read_);
    const std::lock_guard<std::mutex> lock(mutex_);
    ready_.push_back(std::move(result));
    changed_.notify_all();
  }
}

std::optional<ReadResult> Prefetcher::Next() {
  if (next_ >= end_) return std::nullopt;
  const auto begin = std::chrono::steady_clock::now();
  ReadResult result;
  if (ahead_ == 0) {
    result = Read(next_);
  } else {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return !ready_.empty(); });
    result = std::move(ready_.front());
    ready_.pop_front();
    changed_.notify_all();
  }
  ++next_;
  waited_ms_ += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

}  // namespace tutti
