// Options as keywords, and tutti.Config: what a YAML file of `tutti run --config` says.

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/python/pickled.h"
#include "apps/slam/config_table.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti::python {
namespace {

// The value is what the YAML file would have, so that the same words refuse it.
YAML::Node NodeOf(py::object value) {
  if (py::hasattr(value, "tolist")) value = value.attr("tolist")();  // numpy's
  if (py::hasattr(value, "__fspath__")) value = value.attr("__fspath__")();
  if (py::isinstance<py::bool_>(value)) return YAML::Node(value.cast<bool>() ? "true" : "false");
  if (py::isinstance<py::str>(value)) return YAML::Node(value.cast<std::string>());
  if (py::isinstance<py::int_>(value) || py::isinstance<py::float_>(value))
    return YAML::Node(py::repr(value).cast<std::string>());
  if (!py::isinstance<py::list>(value) && !py::isinstance<py::tuple>(value)) {
    throw InputError("a " + py::str(py::type::of(value).attr("__name__")).cast<std::string>() +
                     " is no number, text, truth value or list of them");
  }
  YAML::Node list(YAML::NodeType::Sequence);
  for (const py::handle item : value) list.push_back(NodeOf(py::reinterpret_borrow<py::object>(item)));
  return list;
}

py::object ScalarOf(const YAML::Node& node) {
  const std::string& text = node.Scalar();
  if (node.Tag() == "!") return py::str(text);  // it had quotes
  if (text == "true" || text == "false") return py::bool_(text == "true");
  if (const auto integer = ParseInteger(text)) return py::int_(*integer);
  if (const auto number = ParseDouble(text)) return py::float_(*number);
  return py::str(text);
}

py::object ObjectOf(const std::string& yaml) {
  const YAML::Node node = YAML::Load(yaml);
  if (!node.IsSequence()) return ScalarOf(node);
  py::list list;
  for (const YAML::Node& item : node) list.append(ScalarOf(item));
  return list;
}

// What is said of a key to who writes Python.
std::string InPython(std::string text) {
  const std::pair<const char*, const char*> words[] = {{"::", "."}, {"posterior_by_location", "posteriors"}};
  for (const auto& [word, other] : words) {
    for (std::size_t at; (at = text.find(word)) != std::string::npos;)
      text.replace(at, std::string(word).size(), other);
  }
  return text;
}

[[noreturn]] void Refuse(const std::string& function, const std::string& given, const std::string& name,
                         const std::string& why) {
  throw InputError(function + ": " + given + name + why);
}

// Sets keys below `prefix`; `given` is how the caller got there: "extraction.".
void Assign(const std::string& function, const std::string& prefix, const std::string& given,
            const py::dict& keywords, const ConfigTable& table) {
  std::vector<std::pair<std::string, py::object>> items;
  for (const auto& [name, value] : keywords) {
    const auto word = py::cast<std::string>(name);
    // A preset changes many values, and the other keywords are on top of it.
    items.emplace(word == "preset" ? items.begin() : items.end(), word,
                  py::reinterpret_borrow<py::object>(value));
  }
  for (const auto& [name, value] : items) {
    const std::string path = prefix + name;
    if (table.HasSection(path)) {
      if (!py::isinstance<py::dict>(value)) Refuse(function, given, name, " needs a dict of options");
      std::string within = given;
      within.append(name).append(".");
      Assign(function, path + ".", within, py::reinterpret_borrow<py::dict>(value), table);
      continue;
    }
    const ConfigKey* key = table.Find(path);
    if (key == nullptr) {
      std::string words = function;
      if (!given.empty()) words.append(" in ").append(given, 0, given.size() - 1);
      throw py::type_error(words.append(": ").append(table.Unknown(prefix, name)));
    }
    std::string wrong;
    try {
      wrong = key->read(NodeOf(value));
    } catch (const InputError& error) {
      wrong = error.what();
    }
    if (!wrong.empty()) Refuse(function, given, name, ": " + wrong);
  }
}

}  // namespace

void SetOptions(const std::string& function, const std::string& section, const py::dict& keywords,
                RunConfig& config) {
  RunConfig changed = config;
  const ConfigTable table(changed);
  Assign(function, section.empty() ? "" : section + ".", "", keywords, table);
  DropUnsetCameras(changed.dataset);
  if (const auto problem = FirstProblem(changed)) {
    const std::string where = problem->first == section ? "" : problem->first + ": ";
    throw InputError(function + ": " + where + problem->second);
  }
  config = changed;
}

py::dict OptionsOf(const RunConfig& config, const std::string& section) {
  RunConfig copy = config;
  const ConfigTable table(copy);
  py::dict options;
  for (const ConfigKey& key : table.keys()) {
    if (key.section == section && key.name != "preset") {
      options[key.name.c_str()] = ObjectOf(key.show());
    } else if (key.section.rfind(section + ".", 0) == 0) {
      const std::string within = key.section.substr(section.size() + 1);
      if (!options.contains(within.c_str())) options[within.c_str()] = py::dict();
      options[within.c_str()][key.name.c_str()] = ObjectOf(key.show());
    }
  }
  return options;
}

std::string DescribeOptions(const std::string& section, RunConfig defaults) {
  const ConfigTable table(defaults);
  std::string text, within;
  for (const ConfigKey& key : table.keys()) {
    if (key.section != section && key.section.rfind(section + ".", 0) != 0) continue;
    const bool nested = key.section != section;
    if (nested && key.section != within) text.append(key.section, section.size() + 1).append(": a dict of\n");
    within = nested ? key.section : "";
    text.append(nested ? "    " : "").append(key.name).append(" = ").append(key.show()).append(": ");
    text.append(InPython(key.doc)).append("\n");
  }
  return text;
}

namespace {

RunConfig ConfigOf(const std::optional<std::filesystem::path>& file, const py::kwargs& sections) {
  RunConfig config;
  if (file) config = Reading(*file, [&] { return LoadConfig(*file); });
  SetOptions("Config", "", sections, config);
  return config;
}

}  // namespace

void BindConfig(py::module_& module) {
  py::class_<RunConfig>(
      module, "Config",
      "Everything that a run can be told, as in the YAML files: sections dataset, camera, odometry, loops, "
      "graph, run.\n\nConfig(\"tum.yaml\", run={\"threads\": 1}): each section is a keyword and a dict; what "
      "it says wins over the file. `tutti run --help-config` and describe(section) explain the keys. Raises "
      "tutti.InputError that names file and line.")
      .def(py::init(&ConfigOf), py::arg("file") = py::none())
      .def(Pickled<RunConfig>())
      .def("options", &OptionsOf, py::arg("section"), "The present values of a section.");
  module.def(
      "describe", [](const std::string& section) { return DescribeOptions(section); }, py::arg("section"),
      "What the keys of a section of the configuration do: its options, defaults, units and ranges. The "
      "keywords of LoopDetector are those of section \"loops\", of Camera \"camera\", of PoseGraph.optimize "
      "\"graph\".");
  module.def(
      "default_options", [](const std::string& section) { return OptionsOf(RunConfig(), section); },
      py::arg("section"), "The values that a section of the configuration has where nothing else is said.");
}

}  // namespace tutti::python
