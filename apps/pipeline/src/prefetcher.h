// Reads frames ahead of the tracking, on a thread of its own.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>

#include "tutti/core/span_recorder.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// Frames begin..end-1 of a data set, in order. With ahead = 0 each is read when it is asked for.
class Prefetcher {
 public:
  /// `recorder` may be null.
  Prefetcher(const Dataset& dataset, std::size_t begin, std::size_t end, std::size_t ahead,
             SpanRecorder* recorder = nullptr);
  ~Prefetcher();
  Prefetcher(const Prefetcher&) = delete;
  Prefetcher& operator=(const Prefetcher&) = delete;

  /// The next frame, or why there is none; nothing after the last one.
  std::optional<ReadResult> Next();
  /// Milliseconds that Next() has waited or read so far.
  double WaitedMs() const { return waited_ms_; }

 private:
  void Work();
  ReadResult Read(std::size_t index) const;

  const Dataset& dataset_;
  SpanRecorder* recorder_;
  std::size_t next_, end_, ahead_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<ReadResult> ready_;  // guarded by mutex_
  std::size_t read_;              // index that is read next; of the worker only
  bool stop_ = false;             // guarded by mutex_
  double waited_ms_ = 0;
  std::thread thread_;  // last: starts when everything else is there
};

}  // namespace tutti
