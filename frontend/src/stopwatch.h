// Adds the wall time of a scope to a sum of milliseconds.
#pragma once

#include <chrono>

namespace tutti {

class ScopedStopwatch {
 public:
  explicit ScopedStopwatch(double* milliseconds)
      : sum_(milliseconds), start_(std::chrono::steady_clock::now()) {}
  ~ScopedStopwatch() {
    *sum_ += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
  }
  ScopedStopwatch(const ScopedStopwatch&) = delete;
  ScopedStopwatch& operator=(const ScopedStopwatch&) = delete;

 private:
  double* sum_;
  std::chrono::steady_clock::time_point start_;
};

}  // namespace tutti
