// The Python module, a file for each class that it binds.
#pragma once

#include <pybind11/pybind11.h>

#include "apps/python/header_docs.h"

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
/// Of all functions and methods of the module, for inspect.signature: comes last.
void SetSignatures(const py::module_& module);

}  // namespace tutti::python
