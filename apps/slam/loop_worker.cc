#include "apps/slam/loop_worker.h"

#include <chrono>
#include <string_view>
#include <utility>

#include "core/stopwatch.h"
#include "tutti/core/error.h"

namespace tutti {

std::array<std::pair<const char*, double>, 6> LoopStages(const LoopResult& r) {
  return {{{"extract", r.extract_ms},
           {"quantise", r.quantise_ms},
           {"likelihood", r.likelihood_ms},
           {"filter", r.filter_ms},
           {"verify", r.verify_ms},
           {"memory", r.memory_ms}}};
}

LoopWorker::LoopWorker(const LoopDetectorOptions& options, bool own_thread, SpanRecorder* recorder,
                       bool resumes)
    : detector_(options), recorder_(recorder) {
  // Frames are numbered from 0 in every run: what an earlier run stored has no frame in this one.
  if (detector_.LastId() >= 0 && !resumes) {
    throw InputError(
        options.ltm_file +
        ": holds the locations of an earlier run; remove it, or give another file in loops.ltm_file");
  }
  if (own_thread) thread_ = std::thread(&LoopWorker::Work, this);
}

LoopWorker::~LoopWorker() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

namespace {
void AddStages(const LoopResult& r, Span::Clock::time_point begin, SpanRecorder& recorder) {
  for (const auto& [name, ms] : LoopStages(r)) {
    const auto end = begin + std::chrono::duration_cast<Span::Clock::duration>(
                                 std::chrono::duration<double, std::milli>(ms));
    recorder.Add({Lane::kLoopClosure, name, begin, end, -1});
    begin = end;
  }
}
}  // namespace

LoopWorker::Outcome LoopWorker::Do(const Task& task) {
  const ScopedSpan span(recorder_, Lane::kLoopClosure, "detect");
  const Span::Clock::time_point begin = Span::Clock::now();
  Outcome outcome;
  try {
    for (const auto& [query, candidate] : task.unlinked) detector_.Unlink(query, candidate);
    outcome.result = detector_.Detect(task.query);
    if (recorder_ != nullptr) AddStages(outcome.result, begin, *recorder_);
  } catch (...) {
    outcome.failure = std::current_exception();
  }
  return outcome;
}

void LoopWorker::Work() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stop_ || !tasks_.empty(); });
    if (stop_ && saving_.empty()) return;  // a snapshot is written after the SlamSystem is gone, too
    const Task task = std::move(tasks_.front());
    tasks_.pop_front();
    busy_ = true;
    lock.unlock();
    if (task.saving) {
      DoSave(task.saving.get());
      lock.lock();
    } else {
      Outcome outcome = Do(task);
      lock.lock();
      Add(std::move(outcome));
    }
    busy_ = false;
    changed_.notify_all();
  }
}

// What is being saved has it, too.
void LoopWorker::Add(Outcome outcome) {
  for (const auto& saving : saving_) {
    saving->saved->results.push_back(outcome.result);
    if (outcome.failure) saving->failure = outcome.failure;
  }
  outcomes_.push_back(std::move(outcome));
}

// The queries before it are done: no result comes to it any more.
void LoopWorker::DoSave(Saving* saving) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    saving_.erase(saving_.begin());
  }
  try {
    if (saving->failure) std::rethrow_exception(saving->failure);
    detector_.SaveSections([saving](std::uint32_t tag, std::string_view bytes) {
      saving->saved->detector.emplace_back(tag, bytes);
    });
    saving->done.set_value(std::move(saving->saved));
  } catch (...) {
    saving->done.set_exception(std::current_exception());
  }
}

std::shared_future<std::shared_ptr<const LoopWorker::Saved>> LoopWorker::Save() {
  std::unique_lock<std::mutex> lock(mutex_);
  auto saving = std::make_shared<Saving>();
  saving->saved = std::make_shared<Saved>();
  saving->saved->unlinked = unlinked_;
  saving->saved->waited_ms = waited_ms_;
  for (const Outcome& outcome : outcomes_) {
    saving->saved->results.push_back(outcome.result);
    if (outcome.failure) saving->failure = outcome.failure;
  }
  saving_.push_back(saving);
  auto saved = saving->done.get_future().share();
  if (!thread_.joinable()) {
    lock.unlock();
    DoSave(saving.get());
    return saved;
  }
  tasks_.push_back({{}, {}, std::move(saving)});
  changed_.notify_all();
  return saved;
}

void LoopWorker::Resume(internal::SectionReader* detector, Saved saved) {
  const std::lock_guard<std::mutex> lock(mutex_);
  detector_.LoadSections(detector);
  for (LoopResult& result : saved.results) outcomes_.push_back({std::move(result), nullptr});
  unlinked_ = std::move(saved.unlinked);
  waited_ms_ = saved.waited_ms;
}

void LoopWorker::Submit(LoopQuery query) {
  const std::lock_guard<std::mutex> lock(mutex_);
  Task task{std::exchange(unlinked_, {}), std::move(query), nullptr};
  if (!thread_.joinable()) return Add(Do(task));

  tasks_.push_back(std::move(task));
  changed_.notify_all();
}

void LoopWorker::Unlink(std::int64_t query, std::int64_t candidate) {
  const std::lock_guard<std::mutex> lock(mutex_);
  unlinked_.emplace_back(query, candidate);
}

LoopDetector& LoopWorker::Detector() {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [this] { return tasks_.empty() && !busy_; });
  return detector_;
}

LoopResult LoopWorker::Take() {
  const ScopedSpan span(recorder_, Lane::kTracking, "wait_for_loop");
  const internal::Stopwatch watch;
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [this] { return !outcomes_.empty(); });
  Outcome outcome = std::move(outcomes_.front());
  outcomes_.pop_front();
  waited_ms_ += watch.Milliseconds();
  if (outcome.failure) std::rethrow_exception(outcome.failure);
  return std::move(outcome.result);
}

}  // namespace tutti
