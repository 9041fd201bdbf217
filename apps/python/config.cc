// tutti.Config: what a YAML file of `tutti run --config` says.
#include "tutti/slam/config.h"

#include <pybind11/stl/filesystem.h>

#include <optional>

#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/python/options.h"
#include "apps/python/pickled.h"

namespace tutti::python {
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
