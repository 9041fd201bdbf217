// Which files are compared: by option, by place, or those of a run.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/tutti/evaluation_input.h"
#include "apps/tutti/files.h"
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

}  // namespace tutti::cli
