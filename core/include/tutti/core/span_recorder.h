// Spans of time of a run, for timing tables and trace files.
#pragma once

#include <chrono>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#pragma GCC visibility push(default)
namespace tutti {

/// The lines of a trace: what kind of work a span is, whichever thread does it.
enum class Lane { kReading, kTracking, kMapping, kLoopClosure, kOptimisation };
constexpr int kLanes = 5;
/// "reading", "tracking", "mapping", "loop closure", "optimisation".
const char* ToString(Lane lane);

/// One piece of work. Spans of a lane lie within each other or apart.
struct Span {
  using Clock = std::chrono::steady_clock;
  Lane lane = Lane::kTracking;
  std::string name;
  Clock::time_point begin, end;
  double cpu_ms = 0;  ///< processor time of the calling thread alone; -1: not measured

  double Milliseconds() const { return std::chrono::duration<double, std::milli>(end - begin).count(); }
};

/// Collects spans from any thread. What is not to be measured gets a null pointer instead, and costs nothing.
class SpanRecorder {
 public:
  void Add(Span span);
  /// All spans so far, in the order in which they ended.
  std::vector<Span> Spans() const;

 private:
  mutable std::mutex mutex_;
  std::vector<Span> spans_;  // guarded by mutex_
};

/// Processor time of the calling thread so far [ms].
double ThreadCpuMilliseconds();

/// Records the scope that it lives in; `recorder` may be null.
class ScopedSpan {
 public:
  ScopedSpan(SpanRecorder* recorder, Lane lane, const char* name) : recorder_(recorder) {
    if (recorder_ == nullptr) return;
    span_.lane = lane;
    span_.name = name;
    span_.cpu_ms = -ThreadCpuMilliseconds();
    span_.begin = Span::Clock::now();
  }
  ~ScopedSpan() {
    if (recorder_ == nullptr) return;
    span_.end = Span::Clock::now();
    span_.cpu_ms += ThreadCpuMilliseconds();
    recorder_->Add(std::move(span_));
  }
  ScopedSpan(const ScopedSpan&) = delete;
  ScopedSpan& operator=(const ScopedSpan&) = delete;

 private:
  SpanRecorder* recorder_;
  Span span_;
};

}  // namespace tutti
#pragma GCC visibility pop
