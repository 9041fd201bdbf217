// The Python module, a file for each class that it binds.
#pragma once

#include <pybind11/pybind11.h>

#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "apps/python/header_docs.h"
#include "tutti/slam/config.h"

namespace tutti::python {

namespace py = pybind11;

void BindErrors(py::module_& module);
void BindCamera(py::module_& module);
void BindConfig(py::module_& module);
void BindTrajectories(py::module_& module);
void BindLoopResult(py::module_& module);
void BindLoopDetector(py::module_& module);
void BindDataset(py::module_& module);
void BindOptimizationReport(py::module_& module);
void BindPoseGraph(py::module_& module);
void BindSlamSystem(py::module_& module);
void BindTrajectoryCloser(py::module_& module);
void BindEvaluation(py::module_& module);
void BindDenseMap(py::module_& module);
void BindRecording(py::module_& module);

/// Throws InputError that names `function` and the words that there are.
Sensor SensorNamed(const std::string& function, const std::string& name);

/// Options as keywords: names, types, ranges and sentences are those of the YAML files' keys. Sets what the
/// keywords say, a struct within as a dict: features of `extraction` is extraction={"features": 300}.
/// `section`: of the YAML files that they are keys of; empty: keywords are whole sections. Raises TypeError
/// that names the nearest one for an unknown keyword; throws InputError for a value that is of another type
/// or out of its range.
void SetOptions(const std::string& function, const std::string& section, const py::dict& keywords,
                RunConfig& config);

/// The present values of a section, as SetOptions takes them.
py::dict OptionsOf(const RunConfig& config, const std::string& section);

/// What each keyword of a section does, for a docstring.
std::string DescribeOptions(const std::string& section, RunConfig defaults = {});

/// An object of the library that one Python thread uses at a time, while the others wait, and Python goes on.
template <class T>
class Guarded {
 public:
  explicit Guarded(T object) : object_(std::make_unique<T>(std::move(object))) {}
  explicit Guarded(std::unique_ptr<T> object) : object_(std::move(object)) {}

  /// work(object) without the interpreter's lock: it must not touch Python.
  template <class Work>
  auto Run(Work work) {
    const py::gil_scoped_release release;  // first, or two threads could wait for each other
    const std::lock_guard<std::mutex> lock(mutex_);
    return work(*object_);
  }

 private:
  std::mutex mutex_;
  std::unique_ptr<T> object_;
};

/// A method for py::class_::def, which runs without the interpreter's lock. @{
template <class T, class Result, class... Arguments>
auto Free(Result (T::*method)(Arguments...)) {
  return [method](T& self, Arguments... arguments) {
    const py::gil_scoped_release release;
    return (self.*method)(std::forward<Arguments>(arguments)...);
  };
}
template <class T, class Result, class... Arguments>
auto Free(Result (T::*method)(Arguments...) const) {
  return [method](const T& self, Arguments... arguments) {
    const py::gil_scoped_release release;
    return (self.*method)(std::forward<Arguments>(arguments)...);
  };
}
/// @}

/// A method of a guarded object for py::class_::def; neither it nor its arguments may touch Python. @{
template <class T, class Result, class... Arguments>
auto Locked(Result (T::*method)(Arguments...)) {
  return [method](Guarded<T>& self, Arguments... arguments) {
    return self.Run([&](T& object) { return (object.*method)(std::forward<Arguments>(arguments)...); });
  };
}
template <class T, class Result, class... Arguments>
auto Locked(Result (T::*method)(Arguments...) const) {
  return [method](Guarded<T>& self, Arguments... arguments) {
    return self.Run([&](const T& object) { return (object.*method)(std::forward<Arguments>(arguments)...); });
  };
}
/// @}

/// Asked from a long call, without the interpreter's lock, whether Python wants it to end: a signal has come
/// (Ctrl-C), and its handler has raised an exception.
class Interrupts {
 public:
  bool Came() {
    if (came_) return true;
    const py::gil_scoped_acquire acquire;
    came_ = PyErr_CheckSignals() != 0;
    return came_;
  }
  /// Goes on with that exception, with the lock.
  void Rethrow() const {
    if (came_) throw py::error_already_set();
  }

 private:
  bool came_ = false;
};

}  // namespace tutti::python
