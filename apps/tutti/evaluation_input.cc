#include "apps/tutti/evaluation_input.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "apps/tutti/evaluation_report.h"
#include "apps/tutti/files.h"
#include "tutti/backend/trajectory_file.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

// evo's first word. Its `euroc` is a csv against a file of TUM's format.
void TakeFormat(EvaluationInput& input) {
  if (input.files.empty() || IsFile(input.files.front())) return;
  const std::string word = input.files.front();
  if (word != "tum" && word != "kitti" && word != "euroc") return;
  input.files.erase(input.files.begin());
  input.format = word == "kitti" ? "kitti" : "tum";
  input.reference_format = word;
}

Json Summary(const fs::path& folder) {
  const fs::path file = folder / "summary.json";
  Json json = ReadJson(file,
                       "--run takes the folder of a `tutti run` that has finished; of one that has not, give "
                       "trajectory_live.txt as a file");
  if (!json.is_object()) throw InputError("--run: " + file.string() + ": is no summary of `tutti run`");
  return json;
}

template <typename T>
T At(const Json& json, const std::string& path, T otherwise) {
  const Json::json_pointer pointer("/" + path);
  if (!json.contains(pointer)) return otherwise;
  if constexpr (std::is_same_v<T, std::string>) {
    return json.at(pointer).is_string() ? json.at(pointer).get<T>() : otherwise;
  } else {
    return json.at(pointer).is_number_unsigned() ? json.at(pointer).get<T>() : otherwise;
  }
}

// All runs have to agree where they say what they were compared with.
void Agree(std::string& value, const std::string& of_run, const fs::path& folder, const std::string& option) {
  if (of_run.empty() || value == of_run) return;
  if (!value.empty()) {
    throw InputError("--run " + folder.string() + ": has '" + of_run + "' where the runs before have '" +
                     value + "'; evaluate them one by one" + (option.empty() ? "" : ", or give " + option));
  }
  value = of_run;
}

void TakeRuns(EvaluationInput& input) {
  std::string reference, align;
  for (const fs::path folder : input.runs) {
    const Json summary = Summary(folder);
    if (input.reference.empty())
      Agree(reference, At<std::string>(summary, "evaluation/ground_truth", ""), folder, "--reference");
    if (input.align.empty())
      Agree(align, At<std::string>(summary, "evaluation/alignment", ""), folder, "--align");
    Agree(input.sensor, At<std::string>(summary, "sensor", ""), folder, "");
    if (!IsFile(folder / "trajectory.txt")) {
      throw InputError("--run " + folder.string() +
                       ": has no trajectory.txt; without a calibration a run has "
                       "loops alone");
    }
    const std::string name = fs::absolute(folder / "").parent_path().filename().string();
    const bool named = !input.names.empty();
    for (const auto& [file, what] : {std::pair("trajectory.txt", "final"),
                                     {"trajectory_online.txt", "as first given out"},
                                     {"trajectory_live.txt", "as first given out"},
                                     {"trajectory_odometry.txt", "without loops"}}) {
      if (!IsFile(folder / file)) continue;
      input.estimates.push_back((folder / file).string());
      input.frames_of_run[input.estimates.back()] = At<std::size_t>(summary, "frames/total", 0);
      if (!named) input.run_names[input.estimates.back()] = name + ", " + what;
    }
    const fs::path times = fs::path(At<std::string>(summary, "dataset", "")) / "times.txt";
    if (input.times.empty() && IsFile(times)) input.times = times.string();
  }
  if (input.reference.empty()) input.reference = reference;
  if (input.align.empty()) input.align = align;
}

PoseFile Read(const std::string& file, const std::string& format, const std::vector<double>& times) {
  std::optional<PoseFileFormat> asked;
  if (format != "auto") asked = ParsePoseFileFormat(format);
  return ReadPoseFile(file, asked, times);
}

Eigen::Vector3d Axis(const std::string& name) {
  if (name == "x") return Eigen::Vector3d::UnitX();
  if (name == "y") return Eigen::Vector3d::UnitY();
  return Eigen::Vector3d::UnitZ();
}

EvaluationOptions Options(const EvaluationInput& input) {
  EvaluationOptions options = input.options;
  options.alignment = ParseTrajectoryAlignment(input.align);
  options.plane = ParseProjectionPlane(input.plane);
  if (!input.motion_filter.empty())
    options.motion_filter = MotionFilter{input.motion_filter.at(0), input.motion_filter.at(1)};
  options.vertical = Axis(input.vertical);
  options.rpe_unit = ParseDeltaUnit(input.rpe_unit);
  return options;
}

EvaluatedEstimate Evaluate(const NamedPoses& reference, const EvaluationInput& input,
                           const NamedPoseFile& estimate) {
  EvaluatedEstimate out;
  out.name = estimate.name;
  out.file = estimate.file;
  out.options = Options(input);
  out.report =
      EvaluateFiles(reference, {estimate.file, estimate.poses}, "--times (KITTI: times.txt)", out.options);
  const auto run = input.frames_of_run.find(estimate.file);
  if (run != input.frames_of_run.end() && run->second > 0) {
    out.report.coverage.posed = std::min(estimate.poses.trajectory.size(), run->second);
    out.report.coverage.all = run->second;
  }
  return out;
}

std::vector<double> Times(const std::string& file) {
  if (file.empty()) return {};
  std::vector<double> times = ReadTimes(file);
  if (times.empty()) throw InputError(file + ": holds no time stamp");
  return times;
}

std::vector<double> StampsOfFrames(const std::string& file) {
  std::vector<double> stamps = Times(file);
  const auto back = std::is_sorted_until(stamps.begin(), stamps.end());
  if (back != stamps.end())
    throw InputError(file + ": the stamps go back in time at number " +
                     std::to_string(back - stamps.begin() + 1) + "; sort the file by time");
  return stamps;
}

// The files' names, with as much of their folders as it takes to tell them apart.
std::vector<std::string> ShortNames(const std::vector<std::string>& files) {
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

std::vector<NamedPoseFile> ReadQuietly(const EvaluationInput& input) {
  if (!input.names.empty() && input.names.size() != input.estimates.size()) {
    throw InputError("--name: " + std::to_string(input.names.size()) + " names for " +
                     std::to_string(input.estimates.size()) + " estimates; give one for each");
  }
  const std::vector<double> times = Times(input.times);
  const std::vector<std::string> names = input.names.empty() ? ShortNames(input.estimates) : input.names;
  std::vector<NamedPoseFile> out;
  for (std::size_t k = 0; k < input.estimates.size(); ++k) {
    const auto run = input.run_names.find(input.estimates[k]);
    out.push_back({run == input.run_names.end() ? names[k] : run->second, input.estimates[k],
                   Read(input.estimates[k], input.format, times)});
  }
  return out;
}

}  // namespace

EvaluationInput Resolved(EvaluationInput input) {
  TakeFormat(input);
  if (input.reference_comes_first && input.reference.empty() && !input.files.empty() && input.runs.empty()) {
    input.reference = input.files.front();
    input.files.erase(input.files.begin());
  }
  input.estimates.insert(input.estimates.begin(), input.files.begin(), input.files.end());
  input.files.clear();
  if (input.fit || input.fit_scale) input.align = !input.fit ? "scale" : input.fit_scale ? "sim3" : "se3";
  if (input.fit_origin) input.align = "origin";
  TakeRuns(input);
  input.runs.clear();
  if (input.align.empty()) input.align = "se3";
  return input;
}

std::vector<std::string> FilesOf(const EvaluationInput& input) {
  std::vector<std::string> files = input.estimates;
  for (const std::string& file : {input.reference, input.times, input.frames}) files.push_back(file);
  for (const auto& of_run : input.frames_of_run)
    files.push_back(fs::path(of_run.first).replace_filename("summary.json").string());
  return files;
}

void RequireFiles(const EvaluationInput& input) {
  if (input.reference.empty()) {
    throw InputError(input.frames_of_run.empty()
                         ? "there is no reference; give one as `GT EST...` or with --reference GT"
                         : "the runs have no ground truth; give one with --reference");
  }
  if (input.estimates.empty())
    throw InputError("there is no estimate; give one or several as `GT EST...` or with --estimate EST...");
}

std::vector<NamedPoseFile> ReadEstimates(const EvaluationInput& input) {
  std::vector<NamedPoseFile> out = ReadQuietly(input);
  for (const NamedPoseFile& estimate : out) SayWarnings(estimate.poses.warnings);
  return out;
}

std::vector<EvaluatedEstimate> EvaluateInput(EvaluationInput input) {
  RequireFiles(input);
  input.options.frame_stamps_s = StampsOfFrames(input.frames);
  const std::string& format = input.reference_format.empty() ? input.format : input.reference_format;
  NamedPoses reference = {input.reference, Read(input.reference, format, Times(input.times))};
  std::vector<NamedPoseFile> estimates = ReadQuietly(input);
  for (NamedPoseFile& estimate : estimates) AgreeOnUnit(reference.poses, estimate.poses);
  SayWarnings(reference.poses.warnings);
  std::vector<EvaluatedEstimate> out;
  for (const NamedPoseFile& estimate : estimates) {
    SayWarnings(estimate.poses.warnings);
    out.push_back(Evaluate(reference, input, estimate));
  }
  return out;
}

}  // namespace tutti::cli
