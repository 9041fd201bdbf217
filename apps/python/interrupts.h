// Ctrl-C in long calls.
#pragma once

#include "apps/python/bindings.h"

namespace tutti::python {

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
