// inspect.signature, help() and editors: functions with the signature in the form that Python reads.
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "apps/python/bindings.h"

namespace tutti::python {
namespace {

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

}  // namespace

void SetSignatures(const py::module_& module) {
  for (const auto& [name, value] : module.attr("__dict__").cast<py::dict>()) {
    SetSignature(value);
    if (!PyType_Check(value.ptr())) continue;
    for (const auto& [member, function] : py::dict(value.attr("__dict__"))) SetSignature(function);
  }
}

}  // namespace tutti::python
