#include "apps/tutti/evaluation_input.h"

#include <cstdio>
#include <filesystem>
#include <optional>
#include <set>

#include "apps/tutti/checks.h"
#include "apps/tutti/evaluation_report.h"
#include "tutti/backend/trajectory_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

PoseFile Read(const std::string& file, const std::string& format, const std::vector<double>& times) {
  std::optional<PoseFileFormat> asked;
  if (format != "auto") asked = ParsePoseFileFormat(format);
  PoseFile out = ReadPoseFile(file, asked, times);
  for (const std::string& warning : out.warnings)
    std::fprintf(stderr, "tutti: warning: %s\n", warning.c_str());
  return out;
}

Eigen::Vector3d Axis(const std::string& name) {
  if (name == "x") return Eigen::Vector3d::UnitX();
  if (name == "y") return Eigen::Vector3d::UnitY();
  return Eigen::Vector3d::UnitZ();
}

EvaluationOptions Options(const EvaluationInput& input) {
  EvaluationOptions options = input.options;
  options.alignment = ParseTrajectoryAlignment(input.align);
  options.vertical = Axis(input.vertical);
  options.rpe_unit = ParseDeltaUnit(input.rpe_unit);
  return options;
}

EvaluatedEstimate Evaluate(const NamedPoses& reference, const EvaluationInput& input, const std::string& file,
                           const std::vector<double>& times) {
  EvaluatedEstimate out;
  out.file = file;
  out.options = Options(input);
  out.report = EvaluateFiles(reference, {file, Read(file, input.format, times)}, "--times (KITTI: times.txt)",
                             out.options);
  return out;
}

// The files' names, with as much of their folders as it takes to tell them apart.
std::vector<std::string> ShortNames(const std::vector<std::string>& files) {
  namespace fs = std::filesystem;
  const auto all_differ = [](const std::vector<std::string>& names) {
    return std::set<std::string>(names.begin(), names.end()).size() == names.size();
  };
  std::vector<std::string> names, longer;
  for (const std::string& file : files) {
    const fs::path path(file);
    names.push_back(path.filename().string());
    longer.push_back((path.parent_path().filename() / path.filename()).string());
  }
  return all_differ(names) ? names : all_differ(longer) ? longer : files;
}

void AddFiles(CLI::App& command, EvaluationInput& input) {
  command.add_option("--reference", input.reference, "Ground truth")->required();
  command.add_option("--estimate", input.estimates, "Trajectories to judge, one or several")->required();
  command.add_option("--name", input.names, "Names of the estimates for the table, in their order");
  command
      .add_option("--format", input.format,
                  "auto: by content; tum: 'stamp x y z qx qy qz qw'; kitti: 12 numbers a line; euroc: ASL "
                  "csv; g2o: the vertices of a graph, in the order of their ids")
      ->check(CLI::IsMember({"auto", "tum", "kitti", "euroc", "g2o"}))
      ->capture_default_str();
  command
      .add_option("--reference-format", input.reference_format,
                  "Of the reference, where it is not that of --format")
      ->check(CLI::IsMember({"auto", "tum", "kitti", "euroc", "g2o"}));
  command.add_option("--times", input.times,
                     "KITTI's times.txt: the time stamps of files that have none (kitti, g2o)");
}

void AddAssociation(CLI::App& command, EvaluationInput& input) {
  command
      .add_option("--align", input.align,
                  "How the estimate is laid on the reference: none; origin: first poses coincide; se3: best "
                  "rigid fit; sim3: best fit with scale (mono); scale: the scale of sim3 alone; yaw: turn "
                  "about --vertical and move")
      ->check(CLI::IsMember(TrajectoryAlignmentNames()))
      ->capture_default_str();
  command
      .add_option("--align-first", input.options.align_first,
                  "Align by so many associated poses from the start; 0: by all")
      ->check(NotNegative())
      ->capture_default_str();
  command.add_option("--vertical", input.vertical, "Axis of the reference that yaw turns about")
      ->check(CLI::IsMember({"x", "y", "z"}))
      ->capture_default_str();
  command
      .add_option("--max-diff", input.options.max_time_difference_s, "Largest time difference of a pair [s]")
      ->check(NotNegative())
      ->capture_default_str();
  command.add_option("--time-offset", input.options.time_offset_s, "Added to the estimate's time stamps [s]")
      ->capture_default_str();
  command.add_flag("--interpolate", input.options.interpolate,
                   "Compare with the reference interpolated at the estimate's stamps, not with its nearest "
                   "pose");
  command
      .add_option("--max-gap", input.options.max_interpolation_s,
                  "Don't interpolate between poses further apart [s]")
      ->check(Positive())
      ->capture_default_str();
}

void AddRelative(CLI::App& command, EvaluationInput& input) {
  command.add_option("--rpe-delta", input.options.rpe_delta, "Distance of the relative errors")
      ->check(Positive())
      ->capture_default_str();
  command.add_option("--rpe-unit", input.rpe_unit, "Unit of --rpe-delta")
      ->check(CLI::IsMember(DeltaUnitNames()))
      ->capture_default_str();
  command.add_flag("--rpe-all-pairs", input.options.rpe_all_pairs,
                   "Relative errors from every pose, overlapping");
  command
      .add_option("--rpe-tolerance", input.options.rpe_tolerance,
                  "All pairs: allowed deviation from --rpe-delta, as a fraction of it")
      ->check(NotNegative())
      ->capture_default_str();
}

}  // namespace

void AddEvaluationOptions(CLI::App& command, EvaluationInput& input) {
  AddFiles(command, input);
  AddAssociation(command, input);
  AddRelative(command, input);
}

std::vector<EvaluatedEstimate> EvaluateInput(const EvaluationInput& input) {
  if (!input.names.empty() && input.names.size() != input.estimates.size()) {
    throw InputError("--name: " + std::to_string(input.names.size()) + " names for " +
                     std::to_string(input.estimates.size()) + " estimates; give one for each");
  }
  std::vector<double> times;
  if (!input.times.empty()) {
    times = ReadTimes(input.times);
    if (times.empty()) throw InputError(input.times + ": holds no time stamp");
  }
  const std::string& format = input.reference_format.empty() ? input.format : input.reference_format;
  const NamedPoses reference = {input.reference, Read(input.reference, format, times)};
  const std::vector<std::string> names = input.names.empty() ? ShortNames(input.estimates) : input.names;
  std::vector<EvaluatedEstimate> out;
  for (std::size_t k = 0; k < input.estimates.size(); ++k) {
    out.push_back(Evaluate(reference, input, input.estimates[k], times));
    out.back().name = names[k];
  }
  return out;
}

}  // namespace tutti::cli
