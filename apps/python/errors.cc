#include "apps/python/errors.h"

#include <unistd.h>

#include <exception>

#include "apps/python/bindings.h"

namespace tutti::python {
namespace {

py::handle NewError(py::module_& module, const char* name, const char* doc, const py::tuple& bases) {
  const std::string full = "tutti." + std::string(name);
  const py::handle type = PyErr_NewExceptionWithDoc(full.c_str(), doc, bases.ptr(), nullptr);
  if (!type) throw py::error_already_set();
  module.add_object(name, type);  // the module keeps one reference, and the translator the other for good
  type.inc_ref();
  return type;
}

}  // namespace

bool CanBeRead(const std::filesystem::path& path) { return ::access(path.c_str(), R_OK) == 0; }

void Warn(const std::string& text) {
  if (PyErr_WarnEx(PyExc_RuntimeWarning, text.c_str(), 1) != 0) throw py::error_already_set();
}

void BindErrors(py::module_& module) {
  static py::handle input_error, file_error;
  const py::handle base = NewError(module, "Error", "All errors of tutti. The message says what to do.",
                                   py::make_tuple(py::reinterpret_borrow<py::object>(PyExc_Exception)));
  input_error = NewError(module, "InputError", doc::InputError,
                         py::make_tuple(base, py::reinterpret_borrow<py::object>(PyExc_ValueError)));
  file_error = NewError(module, "FileError", "A file that can't be opened, or not be written in full.",
                        py::make_tuple(input_error, py::reinterpret_borrow<py::object>(PyExc_OSError)));
  py::register_exception_translator(
      [](std::exception_ptr pointer) {  // NOLINT(performance-unnecessary-value-param)
        try {
          if (pointer) std::rethrow_exception(pointer);
        } catch (const FileError& error) {
          PyErr_SetString(file_error.ptr(), error.what());
        } catch (const InputError& error) {
          PyErr_SetString(input_error.ptr(), error.what());
        }
      });
}

}  // namespace tutti::python
