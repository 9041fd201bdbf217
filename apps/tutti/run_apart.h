// Work in processes of its own: memory is measured for each, and a crash ends that one alone.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "apps/run/run_result.h"

namespace tutti::cli {

/// Calls `work` in a copy of this process and returns its status; 128 + signal if it was killed, 2 if it
/// threw (the text goes to stderr). Only one thread may run. Throws InputError if no process can be started.
int RunApart(const std::function<int()>& work);

/// Exit status of a run: 0, 1 if it is void, 130 if it was interrupted.
int StatusOf(const RunResult& result);

/// Statuses that a process leaves for the one that started it, however it ends.
class SharedStatuses {
 public:
  /// Throws InputError if there is no memory.
  explicit SharedStatuses(std::size_t count);
  ~SharedStatuses();
  SharedStatuses(const SharedStatuses&) = delete;
  SharedStatuses& operator=(const SharedStatuses&) = delete;

  void Set(std::size_t i, int status) { statuses_[i] = status; }
  /// All; those that were never set get `otherwise`, or 2 if that is 0.
  std::vector<int> Take(int otherwise) const;

 private:
  std::size_t count_;
  int* statuses_;
};

}  // namespace tutti::cli
