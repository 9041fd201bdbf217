// Runs the loop-closure detector beside the odometry: queries go in and results come out in the same order.
#pragma once

#include <array>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "tutti/core/span_recorder.h"
#include "tutti/loopclosure/detector.h"

#pragma GCC visibility push(default)  // used across libraries
namespace tutti {

/// The detector's stages and how long each took [ms], in their order; memory is one before and one after the
/// filters and stands at the end.
std::array<std::pair<const char*, double>, 6> LoopStages(const LoopResult& result);

/// With `own_thread` the detector works on a thread of its own, else within Submit(); the results are the
/// same.
class LoopWorker {
 public:
  /// `recorder` may be null.
  LoopWorker(const LoopDetectorOptions& options, bool own_thread, SpanRecorder* recorder = nullptr);
  ~LoopWorker();
  LoopWorker(const LoopWorker&) = delete;
  LoopWorker& operator=(const LoopWorker&) = delete;

  void Submit(LoopQuery query);
  /// Takes the loop between two images back (LoopDetector::Unlink), before the next query that is submitted
  /// and after all that were: the same for any number of threads.
  void Unlink(std::int64_t query, std::int64_t candidate);
  /// The result of the oldest query that was not taken yet; waits for it. Rethrows what the detector threw.
  LoopResult Take();
  /// Where an image was taken (LoopDetector::Locate), once the queries that are on their way are done.
  LoopResult Locate(const LoopQuery& query);
  /// Milliseconds that Take() has waited so far.
  double WaitedMs() const { return waited_ms_; }

 private:
  struct Outcome {
    LoopResult result;
    std::exception_ptr failure;
  };
  struct Task {
    std::vector<std::pair<std::int64_t, std::int64_t>> unlinked;  // before the query
    LoopQuery query;
  };
  void Work();
  Outcome Do(const Task& task);

  LoopDetector detector_;
  SpanRecorder* recorder_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::pair<std::int64_t, std::int64_t>> unlinked_;  // guarded by mutex_: for the next task
  std::deque<Task> tasks_;                                       // guarded by mutex_
  std::deque<Outcome> outcomes_;                                 // guarded by mutex_
  bool busy_ = false;                                            // guarded by mutex_: the detector is in use
  bool stop_ = false;                                            // guarded by mutex_
  double waited_ms_ = 0;                                         // of the caller's thread only
  std::thread thread_;                                           // last: starts when everything else is there
};

}  // namespace tutti
#pragma GCC visibility pop
