// Wall time since it was made. Private to the back end.
#pragma once

#include <chrono>

namespace tutti::internal {

class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace tutti::internal
