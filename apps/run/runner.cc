#include "apps/run/runner.h"

#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "apps/run/camera_clocks.h"
#include "apps/run/interrupt.h"
#include "apps/run/live_files.h"
#include "apps/run/outputs.h"
#include "apps/run/run_parts.h"
#include "apps/run/slam_run.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/trajectory_closer.h"

namespace tutti {

namespace fs = std::filesystem;

namespace {

// The path that leads there from any folder.
std::string Absolute(const fs::path& path) {
  if (IsCamera(path.string()) || path.string() == "none") return path.string();
  return fs::absolute(path).lexically_normal().string();
}

}  // namespace

std::string NoteOf(const RunRequest& request) {
  nlohmann::ordered_json note;
  note["command"] = "run";
  note["dataset"] = Absolute(request.dataset);
  note["config"] = request.config.string();
  if (request.ground_truth) note["ground_truth"] = Absolute(*request.ground_truth);
  if (request.map) note["map"] = Absolute(*request.map);
  if (request.save_map) note["save_map"] = request.save_map->string();
  if (request.checkpoint_s) note["checkpoint_s"] = *request.checkpoint_s;
  note["keep"] = request.keep;
  return note.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

RunRequest RequestOf(const std::string& note, const fs::path& file, std::string* elsewhere) {
  const nlohmann::json json = nlohmann::json::parse(note, nullptr, false);
  if (!json.is_object() || !json.contains("dataset"))
    throw InputError(file.string() + ": is no checkpoint of tutti run");
  RunRequest request;
  try {
    request.dataset = json.at("dataset").get<std::string>();
    request.config = json.at("config").get<std::string>();
    if (json.contains("ground_truth")) request.ground_truth = json["ground_truth"].get<std::string>();
    if (json.contains("map")) request.map = json["map"].get<std::string>();
    if (json.contains("save_map")) {
      const std::string map = json["save_map"].get<std::string>();
      if (elsewhere != nullptr && map != kMap) *elsewhere = map;
      request.save_map = kMap;
    }
    if (json.contains("checkpoint_s")) request.checkpoint_s = json["checkpoint_s"].get<double>();
    request.keep = json.value("keep", false);
  } catch (const nlohmann::json::exception& error) {
    throw InputError(file.string() + ": is no checkpoint of tutti run (" + error.what() + ")");
  }
  return request;
}

std::string DatasetOfNote(const std::string& note) {
  const nlohmann::json json = nlohmann::json::parse(note, nullptr, false);
  const bool named = json.is_object() && json.contains("dataset") && json["dataset"].is_string();
  return named ? json["dataset"].get<std::string>() : std::string();
}

RunResult RunSlam(const RunRequest& request) { return RunSlam(request, LoadConfig(request.config)); }

std::optional<BrokenOffRun> ResumeRequest(const fs::path& out) {
  const fs::path checkpoint = out / kCheckpoint;
  if (!fs::exists(checkpoint)) {
    if (fs::exists(out / "summary.json")) return std::nullopt;
    throw InputError(out.string() + ": holds no " + kCheckpoint +
                     " to go on from (a run with --checkpoint SECONDS writes one) and no result; start it "
                     "again with --config and --dataset");
  }
  const MapInfo info = ReadMapInfo(checkpoint);
  BrokenOffRun run;
  run.request = RequestOf(info.note, checkpoint, &run.map);
  run.request.out = out;
  run.request.resume = checkpoint;
  run.config = info.config;
  run.ltm_file = info.ltm_file;
  return run;
}

RunResult RunSlam(const RunRequest& request, const RunConfig& given) {
  RunResult result;
  result.config = WithOverrides(given, request);
  result.config_file = request.config.string();
  result.camera_source = request.camera_source;
  result.camera_guessed = request.camera_guessed;
  result.focal_length = request.focal_length;
  result.dataset = request.dataset.string();
  // The modules use threads of their own where that can't change a result; OpenCV's would reorder keypoints.
  cv::setNumThreads(1);
  std::optional<GivenOdometry> odometry;
  if (request.odometry) {
    odometry.emplace(*request.odometry, request.dataset, result.config.dataset);
    result.config = FollowingConfig(result.config);
  }
  std::vector<std::unique_ptr<Dataset>> datasets;  // of each beginning, as long as its run is there
  datasets.push_back(odometry ? odometry->Open() : OpenDataset(request.dataset, result.config.dataset));
  const Dataset* const dataset = datasets.back().get();
  result.rig = dataset->Rig();
  result.imu = dataset->Imu();
  if (auto& camera = result.config.dataset.camera; camera && camera->width == 0) {  // of a pipe
    camera->width = result.rig.camera.width;
    camera->height = result.rig.camera.height;
    if (result.config.dataset.rotate % 180 != 0) std::swap(camera->width, camera->height);
  }
  std::vector<std::string> warnings = dataset->Warnings();
  if (odometry) warnings.insert(warnings.end(), odometry->notes().begin(), odometry->notes().end());
  const auto reference = ReadReference(*dataset, request, &warnings);
  const InterruptGuard guard;
  if (request.map) RefuseToReplace(request.out, *request.map);
  if (request.odometry) {
    RefuseToReplace(request.out, request.odometry->trajectory);
    for (const auto& beside : {request.odometry->times, request.odometry->sigmas})
      if (beside) RefuseToReplace(request.out, *beside);
  }
  OutputFolder folder = OpenOutputFolder(request, reference ? fs::path(reference->second) : fs::path());
  if (request.trace) internal::CheckWritable(*request.trace, internal::Needs::kBytes);
  if (request.save_map && *request.save_map != kMap)
    internal::CheckWritable(*request.save_map, internal::Needs::kFile);
  if (!request.quiet) {
    for (const std::string& warning : warnings) internal::Say("%s", warning.c_str());
    if (!result.rig.calibrated) {
      internal::Say("no camera calibration: appearance only, loops but no trajectory");
    }
  }
  result.calibration_findings = CheckCalibration(*dataset).findings;
  if (!request.quiet) {
    for (const CalibrationFinding& f : result.calibration_findings) {
      internal::Say("warning: the calibration can't be right: %s; %s", f.measured.c_str(), f.advice.c_str());
    }
  }
  const RunResult blank = result;
  const auto begin = [&] {
    return std::make_unique<SlamRun>(request, *datasets.back(), odometry ? &*odometry : nullptr,
                                     folder.path(), result);
  };
  std::unique_ptr<SlamRun> run = begin();
  Attempts attempts;
  attempts.Try([&] {
    run->TrackAll();
    while (run->clocks()) {
      datasets.push_back(BeginAnew(request, *run->clocks(), blank, result));
      run = begin();
      run->TrackAll();
    }
  });
  attempts.Try([&] { run->Count(); });
  if (!attempts.Failed()) attempts.Try([&] { run->TrackUntouched(); });
  attempts.Try([&] { run->Collect(); });
  attempts.Try([&] { MeasureLoops(result); });
  if (reference) attempts.Try([&] { EvaluateRun(reference->first, reference->second, result); });
  result.failure = attempts.Failure();
  const auto trace = [&run] { return run->Trace(); };
  const auto map = [&run](const fs::path& file) { run->Map().Write(file); };
  WriteOutputs(folder, request, result, map, request.trace ? trace : std::function<std::string()>());
  attempts.Rethrow();
  return result;
}

}  // namespace tutti
