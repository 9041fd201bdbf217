// tutti.evaluate: a trajectory against a reference, as `tutti evaluate --json` has it.
#include "tutti/backend/evaluation.h"

#include <pybind11/stl.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/python/arrays.h"
#include "apps/python/bindings.h"
#include "apps/python/errors.h"
#include "apps/tutti/evaluation_report.h"

namespace tutti::python {
namespace {

py::object PythonOf(const nlohmann::ordered_json& json) {
  if (json.is_boolean()) return py::bool_(json.get<bool>());
  if (json.is_number_integer()) return py::int_(json.get<std::int64_t>());
  if (json.is_number()) return py::float_(json.get<double>());
  if (json.is_string()) return py::str(json.get<std::string>());
  if (json.is_array()) {
    py::list list;
    for (const auto& item : json) list.append(PythonOf(item));
    return list;
  }
  if (!json.is_object()) return py::none();
  py::dict dict;
  for (const auto& [key, value] : json.items()) dict[key.c_str()] = PythonOf(value);
  return dict;
}

// A file, or an array of (N, 8).
cli::NamedPoses NamedPosesOf(const py::object& object, const std::string& name,
                             const std::vector<double>& times) {
  if (!py::isinstance<py::str>(object) && !py::hasattr(object, "__fspath__")) {
    cli::NamedPoses poses;
    poses.name = name;
    poses.poses.trajectory = TrajectoryOf(object, name);
    return poses;
  }
  const auto file = py::module_::import("os").attr("fspath")(object).cast<std::string>();
  cli::NamedPoses read = {file, Reading(file, [&] { return ReadPoseFile(file, {}, times); })};
  return read;
}

py::dict Evaluate(const py::object& reference, const py::object& estimate, const std::string& alignment,
                  const std::vector<double>& times, double max_time_difference_s, double time_offset_s,
                  bool interpolate, double max_interpolation_s, std::size_t align_first,
                  const std::array<double, 3>& vertical, double rpe_delta, const std::string& rpe_unit,
                  bool rpe_all_pairs, double rpe_tolerance, bool errors) {
  EvaluationOptions options;
  options.max_time_difference_s = max_time_difference_s;
  options.time_offset_s = time_offset_s;
  options.interpolate = interpolate;
  options.max_interpolation_s = max_interpolation_s;
  options.align_first = align_first;
  options.vertical = Eigen::Vector3d(vertical[0], vertical[1], vertical[2]);
  options.rpe_delta = rpe_delta;
  options.rpe_unit = ParseDeltaUnit(rpe_unit);
  options.rpe_all_pairs = rpe_all_pairs;
  options.rpe_tolerance = rpe_tolerance;
  options.alignment = ParseTrajectoryAlignment(alignment);
  cli::NamedPoses of_reference = NamedPosesOf(reference, "reference", times);
  cli::NamedPoses of_estimate = NamedPosesOf(estimate, "estimate", times);
  AgreeOnUnit(of_reference.poses, of_estimate.poses);
  for (const cli::NamedPoses& read : {of_reference, of_estimate}) {
    for (const std::string& warning : read.poses.warnings) Warn(warning);
  }
  EvaluationReport report;
  {
    const py::gil_scoped_release release;
    report =
        cli::EvaluateFiles(of_reference, of_estimate, "times (read_times of KITTI's times.txt)", options);
  }
  py::dict result = PythonOf(cli::ReportJson(report, options));
  if (!errors) return result;
  py::dict lists;
  lists["stamp"] = report.poses.stamps_s;
  lists["translation"] = report.absolute.translation;
  lists["rotation_deg"] = report.absolute.rotation_deg;
  result["errors"] = lists;
  return result;
}

std::string DescribeEvaluation() {
  const auto line = [](const char* name, const char* text) { return std::string(name) + ": " + text + "\n"; };
  return std::string(
             "The errors of an estimate against a reference, with the conventions and numbers of evo: a dict "
             "of plain numbers, texts and lists, with the keys of `tutti evaluate --json` "
             "(docs/evaluation.md), and unless errors=False a dict \"errors\" of lists, one number for each "
             "pair: stamp [s], translation [m], rotation_deg. pandas.json_normalize makes a row of it.\n\n"
             "reference, estimate: a file (tum, kitti, euroc, g2o) or an array (N, 8): stamp [s], x, y, z "
             "[m], qx, qy, qz, qw.\nalignment: none, origin, se3, sim3 (one camera), scale or yaw.\n"
             "times: time stamps of files that have none (kitti, g2o).\n") +
         line("max_time_difference_s", doc::EvaluationOptions_max_time_difference_s) +
         line("time_offset_s", doc::EvaluationOptions_time_offset_s) +
         line("interpolate", doc::EvaluationOptions_interpolate) +
         line("max_interpolation_s", doc::EvaluationOptions_max_interpolation_s) +
         line("align_first", doc::EvaluationOptions_align_first) +
         line("vertical", "alignment yaw: the axis to turn about, in the reference") +
         line("rpe_delta", doc::EvaluationOptions_rpe_delta) +
         "rpe_unit: frames, metres, degrees or seconds\n" +
         line("rpe_all_pairs", doc::EvaluationOptions_rpe_all_pairs) +
         line("rpe_tolerance", doc::EvaluationOptions_rpe_tolerance);
}

}  // namespace

void BindEvaluation(py::module_& module) {
  using namespace pybind11::literals;  // NOLINT(google-build-using-namespace)
  const EvaluationOptions d;
  module.def(
      "evaluate", &Evaluate, "reference"_a, "estimate"_a, "alignment"_a = ToString(d.alignment),
      py::kw_only(), "times"_a = std::vector<double>(), "max_time_difference_s"_a = d.max_time_difference_s,
      "time_offset_s"_a = d.time_offset_s, "interpolate"_a = d.interpolate,
      "max_interpolation_s"_a = d.max_interpolation_s, "align_first"_a = d.align_first,
      "vertical"_a = std::array<double, 3>{d.vertical.x(), d.vertical.y(), d.vertical.z()},
      "rpe_delta"_a = d.rpe_delta, "rpe_unit"_a = ToString(d.rpe_unit), "rpe_all_pairs"_a = d.rpe_all_pairs,
      "rpe_tolerance"_a = d.rpe_tolerance, "errors"_a = true, DescribeEvaluation().c_str());
}

}  // namespace tutti::python
