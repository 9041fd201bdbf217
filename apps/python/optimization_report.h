// What is said of a pose graph's solution.
#pragma once

#include <pybind11/numpy.h>

#include <cstddef>

#include "apps/python/bindings.h"
#include "tutti/backend/pose_graph_optimizer.h"

namespace tutti::python {

/// An array of take(0), take(1), ...
template <class T, class Take>
py::array_t<T> Column(std::size_t size, Take take) {
  py::array_t<T> array(static_cast<py::ssize_t>(size));
  T* values = array.mutable_data();
  for (std::size_t i = 0; i < size; ++i) values[i] = take(i);
  return array;
}

/// "chi2", "chi2log", "chordal".
py::dict CostsOf(const GraphCosts& costs);

}  // namespace tutti::python
