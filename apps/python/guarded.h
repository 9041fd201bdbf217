// Objects of the library in Python, where several threads may call at once.
#pragma once

#include <mutex>
#include <utility>

#include "apps/python/bindings.h"

namespace tutti::python {

/// An object that one thread uses at a time, while the others wait, and Python goes on.
template <class T>
class Guarded {
 public:
  explicit Guarded(T object) : object_(std::move(object)) {}

  /// work(object) without the interpreter's lock: it must not touch Python.
  template <class Work>
  auto Run(Work work) {
    const py::gil_scoped_release release;  // first, or two threads could wait for each other
    const std::lock_guard<std::mutex> lock(mutex_);
    return work(object_);
  }

 private:
  std::mutex mutex_;
  T object_;
};

}  // namespace tutti::python
