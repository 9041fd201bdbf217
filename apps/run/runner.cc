#include "apps/run/runner.h"

#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <utility>

#include "apps/run/attempts.h"
#include "apps/run/checkpoint.h"
#include "apps/run/interrupt.h"
#include "apps/run/outputs.h"
#include "apps/run/run_evaluation.h"
#include "apps/run/run_note.h"
#include "apps/run/run_parts.h"
#include "apps/run/slam_run.h"
#include "tutti/core/error.h"
#include "tutti/slam/trajectory_closer.h"

namespace tutti {
namespace {

namespace fs = std::filesystem;

// What can't be written is known before the long work. An earlier trace stays until then.
void CheckTrace(const fs::path& file) {
  if (!std::ofstream(file, std::ios::app))
    throw InputError(file.string() + ": can't be written; check that the folder exists and is writable");
}

}  // namespace

RunResult RunSlam(const RunRequest& request) { return RunSlam(request, LoadConfig(request.config)); }

std::optional<std::pair<RunRequest, RunConfig>> ResumeRequest(const fs::path& out) {
  const fs::path checkpoint = out / kCheckpoint;
  if (!fs::exists(checkpoint)) {
    if (fs::exists(out / "summary.json")) return std::nullopt;
    throw InputError(out.string() + ": holds no " + kCheckpoint +
                     " to go on from (a run with --checkpoint SECONDS writes one) and no result; start it "
                     "again with --config and --dataset");
  }
  const MapInfo info = ReadMapInfo(checkpoint);
  RunRequest request = RequestOf(info.note, checkpoint);
  request.out = out;
  request.resume = checkpoint;
  return std::make_pair(std::move(request), info.config);
}

RunResult RunSlam(const RunRequest& request, const RunConfig& given) {
  RunResult result;
  result.config = WithOverrides(given, request);
  result.config_file = request.config.string();
  result.camera_source = request.camera_source;
  result.camera_guessed = request.camera_guessed;
  result.measuring_cpu_s = request.measuring_cpu_s;
  result.dataset = request.dataset.string();
  // The modules use threads of their own where that can't change a result; OpenCV's would reorder keypoints.
  cv::setNumThreads(1);
  std::optional<GivenOdometry> odometry;
  if (request.odometry) {
    odometry.emplace(*request.odometry, request.dataset, result.config.dataset);
    result.config = FollowingConfig(result.config);
  }
  const std::unique_ptr<Dataset> dataset =
      odometry ? odometry->Open() : OpenDataset(request.dataset, result.config.dataset);
  result.rig = dataset->Rig();
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
  if (request.trace) CheckTrace(*request.trace);
  if (!request.quiet) {
    for (const std::string& warning : warnings) std::fprintf(stderr, "tutti: %s\n", warning.c_str());
    if (!result.rig.calibrated) {
      std::fprintf(stderr, "tutti: no camera calibration: appearance only, loops but no trajectory\n");
    }
  }
  result.calibration_findings = CheckCalibration(*dataset).findings;
  if (!request.quiet) {
    for (const CalibrationFinding& f : result.calibration_findings) {
      std::fprintf(stderr, "tutti: warning: the calibration can't be right: %s; %s\n", f.measured.c_str(),
                   f.advice.c_str());
    }
  }
  SlamRun run(request, result.config, *dataset, odometry ? &*odometry : nullptr, folder.path(), result);
  Attempts attempts;
  attempts.Try([&] { run.TrackAll(); });
  attempts.Try([&] { run.Count(); });
  if (!attempts.Failed()) attempts.Try([&] { run.TrackUntouched(); });
  attempts.Try([&] { run.Collect(); });
  attempts.Try([&] { MeasureLoops(result); });
  if (reference) attempts.Try([&] { EvaluateRun(reference->first, reference->second, result); });
  result.failure = attempts.Failure();
  const auto trace = [&run] { return run.Trace(); };
  const auto map = [&run](const fs::path& file) { run.Map().Write(file); };
  WriteOutputs(folder, request, result, map, request.trace ? trace : std::function<std::string()>());
  attempts.Rethrow();
  return result;
}

}  // namespace tutti
