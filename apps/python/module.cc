// import tutti: the module that tutti/__init__.py takes everything from, its errors, and the signatures of
// its functions.
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <string>
#include <vector>

#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "tutti/slam/version.h"

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

// At commas that are in no bracket and no quotes.
std::vector<std::string> Parameters(const std::string& list) {
  std::vector<std::string> out(1);
  int depth = 0;
  char quote = '\0';
  for (const char c : list) {
    if (quote != '\0') {
      if (c == quote) quote = '\0';
    } else if (c == '\'' || c == '"') {
      quote = c;
    } else if (c == '(' || c == '[' || c == '{') {
      ++depth;
    } else if (c == ')' || c == ']' || c == '}') {
      --depth;
    } else if (c == ',' && depth == 0) {
      out.emplace_back();
      continue;
    }
    if (c != ' ' || !out.back().empty()) out.back() += c;
  }
  return out;
}

// "image: object = None" without its type; a default that is no literal is left as "...".
std::string Bare(const std::string& parameter) {
  const std::size_t equals = parameter.rfind(" = ");
  std::string name = parameter.substr(0, std::min(parameter.find(':'), equals));
  if (equals == std::string::npos) return name;
  const std::string value = parameter.substr(equals + 3);
  return name + "=" + (value.find('<') == std::string::npos ? value : "...");
}

// From pybind11's own first line, "track(self: tutti.SlamSystem, frame: tutti.Frame) -> ..."; empty for
// others.
std::string TextSignature(const std::string& doc) {
  const std::string line = doc.substr(0, doc.find('\n'));
  const std::size_t open = line.find('('), close = line.rfind(") -> ");
  if (open == std::string::npos || close == std::string::npos || close < open) return {};
  std::string out = line.substr(0, open + 1);
  const std::vector<std::string> parameters = Parameters(line.substr(open + 1, close - open - 1));
  for (std::size_t i = 0; i < parameters.size(); ++i)
    out += (i > 0 ? ", " : "") + (parameters[i].empty() ? "" : Bare(parameters[i]));
  return out + ")\n--\n\n";
}

void SetSignature(py::handle object) {
  py::handle function = object;
  if (PyInstanceMethod_Check(function.ptr())) function = PyInstanceMethod_Function(function.ptr());
  py::object held;
  if (std::strcmp(Py_TYPE(function.ptr())->tp_name, "staticmethod") == 0) {
    held = function.attr("__func__");
    function = held;
  }
  if (!PyCFunction_Check(function.ptr())) return;
  PyMethodDef* const definition = reinterpret_cast<PyCFunctionObject*>(function.ptr())->m_ml;
  if (definition->ml_doc == nullptr) return;
  const std::string doc = definition->ml_doc, signature = TextSignature(doc);
  if (signature.empty()) return;
  char* const both = strdup((signature + doc).c_str());  // pybind11 frees it
  if (both == nullptr) return;
  std::free(const_cast<char*>(definition->ml_doc));  // NOLINT(cppcoreguidelines-pro-type-const-cast)
  definition->ml_doc = both;
}

// Gives all functions and methods of the module, for inspect.signature, help() and editors, the
// signature in the form that Python reads.
void SetSignatures(const py::module_& module) {
  for (const auto& [name, value] : module.attr("__dict__").cast<py::dict>()) {
    SetSignature(value);
    if (!PyType_Check(value.ptr())) continue;
    for (const auto& [member, function] : py::dict(value.attr("__dict__"))) SetSignature(function);
  }
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

// What another one's signature names is bound before it.
PYBIND11_MODULE(_tutti, module) {
  using namespace tutti::python;      // NOLINT(google-build-using-namespace)
  module.attr("__name__") = "tutti";  // where the classes are for those who read their names
  module.doc() = "Visual SLAM and loop closure. docs/python.md explains it.";
  module.attr("__version__") = tutti::kVersion;
  BindErrors(module);
  BindCamera(module);
  BindConfig(module);
  BindTrajectories(module);
  BindLoopResult(module);
  BindLoopDetector(module);
  BindDataset(module);
  BindOptimizationReport(module);
  BindPoseGraph(module);
  BindSlamSystem(module);
  BindTrajectoryCloser(module);
  BindEvaluation(module);
  BindDenseMap(module);
  BindRecording(module);
  SetSignatures(module);
}
