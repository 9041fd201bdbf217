// Reads frames ahead of the tracking, on a thread of its own.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

#include "tutti/core/span_recorder.h"
#include "tutti/frontend/dataset.h"

namespace tutti {

/// What a Prefetcher reads, and how.
struct PrefetchOptions {
  std::size_t begin = 0, end = 0;  ///< frames begin..end-1, fewer if the data set ends before
  std::size_t ahead = 0;           ///< most frames that wait; 0: each is read when it is asked for
  bool newest = false;             ///< with ahead > 0: a full queue drops its oldest frame, as a camera does
  std::function<void(InputFrame&)> prepare;  ///< on the reading thread, with each frame; empty: nothing
  std::function<bool()> stop;                ///< asked while a growing data set is waited for; empty: never
  SpanRecorder* recorder = nullptr;          ///< may be null
};

/// A frame of a data set and its place there.
struct FetchedFrame {
  std::size_t position = 0;
  ReadResult read;
  double read_ms = 0, prepare_ms = 0;  ///< time that reading and PrefetchOptions::prepare took
};

/// Frames of a data set, in order.
class Prefetcher {
 public:
  Prefetcher(const Dataset& dataset, PrefetchOptions options);
  ~Prefetcher();
  Prefetcher(const Prefetcher&) = delete;
  Prefetcher& operator=(const Prefetcher&) = delete;

  /// The next frame, or why there is none; nothing after the last one.
  std::optional<FetchedFrame> Next();
  /// Goes on at this position, if that lies ahead.
  void SkipTo(std::size_t position);
  /// Milliseconds that Next() has waited or read so far.
  double WaitedMs() const { return waited_ms_; }

 private:
  void Work();
  bool Available(std::size_t position) const;
  FetchedFrame Read(std::size_t position) const;

  const Dataset& dataset_;
  const PrefetchOptions options_;
  std::size_t next_;  // first position that is still wanted; with a worker guarded by mutex_
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<FetchedFrame> ready_;  // guarded by mutex_
  std::size_t read_;                // position that is read next; guarded by mutex_
  bool finished_ = false;           // guarded by mutex_
  bool stop_ = false;               // guarded by mutex_
  double waited_ms_ = 0;
  std::thread thread_;  // last: starts when everything else is there
};

}  // namespace tutti
