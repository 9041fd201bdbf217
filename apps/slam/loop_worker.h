// Runs the loop-closure detector beside the odometry: queries go in and results come out in the same order.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <exception>
#include <future>
#include <memory>
#include <mutex>
#include <string>
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
/// same. `resumes`: Resume() will be called, and takes the place of what a long-term memory's file holds.
class LoopWorker {
 public:
  /// `recorder` may be null.
  LoopWorker(const LoopDetectorOptions& options, bool own_thread, SpanRecorder* recorder = nullptr,
             bool resumes = false);
  ~LoopWorker();
  LoopWorker(const LoopWorker&) = delete;
  LoopWorker& operator=(const LoopWorker&) = delete;

  void Submit(LoopQuery query);
  /// Takes the loop between two images back (LoopDetector::Unlink), before the next query that is submitted
  /// and after all that were: the same for any number of threads.
  void Unlink(std::int64_t query, std::int64_t candidate);
  /// The detector, once the queries that are on their way are done; until the next one is submitted.
  LoopDetector& Detector();
  /// The result of the oldest query that was not taken yet; waits for it. Rethrows what the detector threw.
  LoopResult Take();
  /// Milliseconds that Take() has waited so far.
  double WaitedMs() const { return waited_ms_; }

  /// All that it knows.
  struct Saved {
    std::vector<std::pair<std::uint32_t, std::string>> detector;  ///< sections (LoopDetector::SaveSections)
    std::vector<LoopResult> results;                              ///< that were not taken yet
    std::vector<std::pair<std::int64_t, std::int64_t>> unlinked;  ///< to be before the next query
    double waited_ms = 0;
  };
  /// Comes when the queries that were submitted so far are done; what happens later is not in it. Rethrows
  /// what the detector threw.
  std::shared_future<std::shared_ptr<const Saved>> Save();
  /// Goes on from what was saved. `detector` gives the detector's sections. Nothing was submitted yet.
  void Resume(internal::SectionReader* detector, Saved saved);

 private:
  struct Outcome {
    LoopResult result;
    std::exception_ptr failure;
  };
  struct Saving {
    std::shared_ptr<Saved> saved;
    std::promise<std::shared_ptr<const Saved>> done;
    std::exception_ptr failure;
  };
  struct Task {
    std::vector<std::pair<std::int64_t, std::int64_t>> unlinked;  // before the query
    LoopQuery query;
    std::shared_ptr<Saving> saving;  // not null: to save, instead of a query
  };
  void Work();
  Outcome Do(const Task& task);
  void Add(Outcome outcome);
  void DoSave(Saving* saving);

  LoopDetector detector_;
  SpanRecorder* recorder_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::pair<std::int64_t, std::int64_t>> unlinked_;  // guarded by mutex_: for the next task
  std::deque<Task> tasks_;                                       // guarded by mutex_
  std::deque<Outcome> outcomes_;                                 // guarded by mutex_
  std::vector<std::shared_ptr<Saving>> saving_;                  // guarded by mutex_: not done yet
  bool busy_ = false;                                            // guarded by mutex_: the detector is in use
  bool stop_ = false;                                            // guarded by mutex_
  double waited_ms_ = 0;                                         // of the caller's thread only
  std::thread thread_;                                           // last: starts when everything else is there
};

}  // namespace tutti
#pragma GCC visibility pop
