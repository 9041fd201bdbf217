// tutti run: SLAM on a data set.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "apps/reconstruct/reconstruction.h"
#include "apps/run/focal_length.h"
#include "apps/run/outputs.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/recording_options.h"
#include "apps/tutti/run_with_report.h"
#include "apps/tutti/saved_map.h"
#include "apps/tutti/text_table.h"
#include "core/example_configs.h"
#include "core/replaced_file.h"
#include "core/terminal.h"
#include "core/text_reader.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/slam/config.h"
#include "tutti/slam/map_file.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct RunArguments {
  RunRequest request;  // what the options say of it themselves
  std::string config, dataset, resume, mask;
  CameraRequest camera;
  int rotate = 0;
  std::vector<std::string> set;  // SECTION.KEY=VALUE
  bool help_config = false, advanced = false, no_map = false, dense = false;
  double follow_s = 10, checkpoint_s = 30;
  ViewOptions view;
  OutcomeOptions outcome;
};

// Before the run: what would make --dense impossible after it.
void CheckDense(const RunArguments& arguments, const RunRequest& request, const RunConfig& config) {
  if (!arguments.dense) return;
  if (!request.save_map) throw InputError("run: --dense makes its mesh from the map; leave --no-map away");
  if (IsCamera(arguments.dataset))
    throw InputError("run: --dense reads the images again, and those of a camera come once; record them");
  if (config.dataset.sensor == Sensor::kMono)
    throw InputError(
        "run: --dense needs depth or stereo images; with one camera, give tutti dense --depth DIR after the "
        "run");
}

// OUT/mesh.ply, with the poses after the last correction.
void MakeDense(const RunRequest& request, const RunResult& result, const RunConfig& config) {
  const fs::path map_file = *request.save_map == kMap ? fs::path(result.folder) / kMap : *request.save_map;
  const SavedMap map = ReadSavedMap(map_file, 0, SessionFrames::kOfSession);
  const std::unique_ptr<Dataset> dataset = OpenRecording(map, request.dataset.string());
  ReconstructionRequest dense;
  dense.mesh = fs::path(result.folder) / kMesh;
  dense.report = result.folder;
  dense.dense.threads = request.threads.value_or(config.run.threads);
  dense.quiet = request.quiet;
  const Reconstruction made = Reconstruct(map.model, *dataset, dense);
  SayWarnings(made.warnings);
  for (const ExportedFile& written : made.files)
    std::printf("  %s: %s\n", written.path.filename().c_str(), written.content.c_str());
  std::printf("  tutti dense %s makes grids, clouds and finer meshes\n",
              internal::Printable(result.folder.string()).c_str());
}

int RunAndShow(const RunArguments& arguments, const RunRequest& request, const RunConfig& config) {
  CheckDense(arguments, request, config);
  const RunResult result = RunAndPrint(request, config, arguments.outcome);
  if (arguments.dense && !result.interrupted && !result.trajectory.empty())
    MakeDense(request, result, config);
  if (request.timing) {
    std::fputs(TimingTable(result.stages, result.wall_s, result.cpu_s, result.frames_total).c_str(), stdout);
    if (result.odometry_alone_cpu_s > 0)
      std::printf("  the odometry without loops: %.1f s more\n", result.odometry_alone_cpu_s);
  }
  std::printf("\n  results are in %s\n", internal::Printable(result.folder.string()).c_str());
  const fs::path report = fs::path(result.folder) / "report.html";
  std::error_code ignored;
  if (!arguments.outcome.no_report && fs::exists(report, ignored))
    std::printf("  look at %s\n", internal::Printable(fs::absolute(report, ignored).string()).c_str());
  return Conclude(result, arguments.outcome);
}

// What a run can be told that goes on: the rest is as it was.
void RefuseOthers(const CLI::App& command, const RunArguments& arguments) {
  const std::set<std::string> allowed = {"--resume",    "--threads",   "--quiet",        "--view",
                                         "--view-port", "--view-wait", "--view-address", "--timing",
                                         "--no-report", "--require",   "--trace",        "--checkpoint",
                                         "--save-map",  "--no-map",    "--set"};
  for (const CLI::Option* option : command.get_options()) {
    const std::string name = option->get_name();
    if (option->count() > 0 && allowed.count(name) == 0)
      throw InputError("run: " + name +
                       " can't be given with --resume, which takes data set, configuration "
                       "and frames from the checkpoint");
  }
  for (const std::string& assignment : arguments.set) {
    if (assignment.rfind("loops.ltm_file=", 0) != 0)
      throw InputError("run: --set " + assignment +
                       ": with --resume, only loops.ltm_file can be set: the rest is in the checkpoint");
  }
}

int Resume(const CLI::App& command, const RunArguments& arguments) {
  RefuseOthers(command, arguments);
  auto found = ResumeRequest(arguments.resume);
  if (!found) {
    std::printf("tutti: the run in %s has finished; there is nothing to go on with\n",
                arguments.resume.c_str());
    return 0;
  }
  auto& [request, config, map, ltm_file] = *found;
  const RunRequest& given = arguments.request;
  const auto keep = [&](const std::string& file, bool said, const char* option) {
    if (file.empty() || said || arguments.outcome.quiet) return;
    internal::Say("the run also wrote %s; to have it written again, give %s%s", file.c_str(), option,
                  file.c_str());
  };
  keep(map, given.save_map || arguments.no_map, "--save-map ");
  keep(ltm_file, !arguments.set.empty(), "--set loops.ltm_file=");
  SetOptions(arguments.set, config);
  request.quiet = arguments.outcome.quiet;
  request.timing = given.timing;
  if (given.trace) request.trace = given.trace;
  if (given.threads) request.threads = given.threads;
  if (command.count("--checkpoint") > 0) request.checkpoint_s = arguments.checkpoint_s;
  if (given.save_map) request.save_map = given.save_map;
  if (arguments.no_map) request.save_map.reset();
  StartView(command, arguments.view, arguments.outcome.quiet, request.observers);
  return RunAndShow(arguments, request, config);
}

// What the map was made with, for a recording of which all frames are used.
RunConfig ConfigOfMap(const fs::path& map) {
  RunConfig config = ReadMapInfo(map).config;
  config.dataset = ForAnotherRecording(config.dataset);
  return config;
}

void SetImageUse(const RunArguments& arguments, DatasetOptions& options) {
  SetMask(arguments.mask, options);
  if (arguments.rotate != 0) options.rotate = arguments.rotate;
}

// Where nothing says what the focal length is, the images may.
void MeasureGuess(const RunArguments& arguments, Recording& recording, RunRequest& request) {
  const auto say = [&](const std::string& text) {
    if (!arguments.outcome.quiet)
      std::fputs(internal::Message("  camera  " + text).c_str(), internal::StandardError());
  };
  say("measuring the focal length on the first frames ...");
  RunConfig range = recording.config;
  if (request.start) range.dataset.start = *request.start;
  if (request.end) range.dataset.end = *request.end;
  if (request.stride) range.dataset.stride = *request.stride;
  const FocalLength found = MeasureFocalLength(arguments.dataset, range);
  request.focal_length = found;
  if (found.measured) recording.config.dataset.camera = found.camera;
  request.camera_guessed = !found.measured && recording.photo_lens.empty();
  request.camera_source = FocalLengthText(found, recording.photo_lens);
  say(request.camera_source);
}

// From a file, or from the map to go on in, or from what the recording is.
RunConfig ConfigFor(const RunArguments& arguments, RunRequest& request) {
  if (!arguments.config.empty() || request.map) {
    RunConfig config = arguments.config.empty() ? ConfigOfMap(*request.map) : LoadConfig(arguments.config);
    SetCamera(arguments.dataset, arguments.camera, config);
    SetImageUse(arguments, config.dataset);
    return config;
  }
  RunConfig asked;
  SetOptions(arguments.set, asked);
  CameraRequest wanted = arguments.camera;
  wanted.depth_units_per_m = asked.dataset.depth_units_per_m;
  Recording recording = Recognise(arguments.dataset, wanted);
  if (!arguments.outcome.quiet) SayFindings(recording);
  SetImageUse(arguments, recording.config.dataset);
  SetOptions(arguments.set, recording.config);
  if (recording.guessed_lens && IsCamera(arguments.dataset)) {
    request.camera_guessed = true;
    request.camera_source = "focal length guessed: frames that come once can't be measured before";
  } else if (recording.guessed_lens) {
    MeasureGuess(arguments, recording, request);
  }
  return recording.config;
}

// Before the images are read, to measure a focal length for example. A file in --out has its folder later.
void CheckRequest(const RunRequest& request) {
  OutputFolder::Check(request.out, RunLayout(), request.trace);
  if (request.ground_truth && *request.ground_truth != "none")
    internal::RequireFile(*request.ground_truth, "give --ground-truth FILE or none");
  const auto inside = [&](const fs::path& file) {
    return fs::absolute(file).parent_path().lexically_normal() ==
           fs::absolute(request.out).lexically_normal();
  };
  if (request.trace && !inside(*request.trace))
    internal::CheckWritable(*request.trace, internal::Needs::kBytes);
  if (request.save_map && *request.save_map != kMap && !inside(*request.save_map))
    internal::CheckWritable(*request.save_map, internal::Needs::kFile);
}

int RunOnce(const CLI::App& command, const RunArguments& arguments) {
  if (arguments.help_config) {
    std::fputs(HelpConfig(arguments.advanced, internal::TerminalColumns(stdout)).c_str(), stdout);
    return 0;
  }
  if (!arguments.resume.empty()) return Resume(command, arguments);
  if (arguments.dataset.empty()) {
    throw InputError(
        "run: which recording? Give its folder, a video file, a bag or camera:0: tutti run DATASET");
  }
  RunRequest request = arguments.request;
  request.config = arguments.config;
  request.dataset = arguments.dataset;
  if (request.out.empty())
    request.out = DefaultOutput(IsCamera(arguments.dataset) ? "camera" : arguments.dataset);
  request.quiet = arguments.outcome.quiet;
  if (command.count("--follow") > 0) request.follow_s = arguments.follow_s;
  if (command.count("--checkpoint") > 0) request.checkpoint_s = arguments.checkpoint_s;
  request.realtime = request.realtime || IsCameraDevice(arguments.dataset);  // a camera does not wait
  if (request.checkpoint_s && request.realtime)
    throw InputError("run: --checkpoint: in real time, or with a camera, there is no going on later");
  if (!request.save_map && !arguments.no_map) request.save_map = kMap;
  CheckRequest(request);
  StartView(command, arguments.view, request.quiet, request.observers);
  RunConfig config = ConfigFor(arguments, request);
  SetOptions(arguments.set, config);
  return RunAndShow(arguments, request, config);
}

}  // namespace

void SetUpRun(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<RunArguments>();
  RunRequest& request = arguments->request;
  command.add_option(
      "dataset,--dataset", arguments->dataset,
      "the recording: folder of a data set or of images, a video file, a ROS bag, or a camera: camera:0 (the "
      "first one), camera:1, ...; camera:LEFT,RIGHT (camera:0,1) with --sensor stereo, or one camera whose "
      "images have left and right side by side; camera:COLOUR,DEPTH with --sensor rgbd; files stand in for "
      "cameras (camera:FILE); or the address of a stream, rtsp://... or http://...");
  command.add_option("--config", arguments->config,
                     "YAML file, or the name of one for a public data set that is part of tutti (" +
                         JoinText(internal::ExampleConfigNames()) +
                         "). Without it, layout, sensor and calibration are found in the recording, and what "
                         "was found is said");
  AddCameraOptions(command, arguments->camera);
  AddMaskOption(command, arguments->mask);
  AddOption(
      command, "--rotate", arguments->rotate,
      "turn the images so far clockwise, so that they are upright; the camera is given as it is, before "
      "that, and is turned with them. Not for stereo",
      OneOf({"90", "180", "270"}));
  command.add_option("--out", request.out,
                     "folder for the results (default: tutti-out/NAME): a new or empty one, or that of an "
                     "earlier run, whose results are replaced when the new ones are complete");
  command.add_flag(
      "--keep", request.keep,
      "don't replace earlier results in --out: move them into OUT/1, the next ones into OUT/2, ...");
  AddPath(command, "--map", request.map,
          "map.tutti of an earlier run: go on in it, as another session; the map that is written holds both. "
          "Without --config, the map's configuration is used");
  command.add_flag("--no-map", arguments->no_map, "don't write the map (OUT/map.tutti)");
  AddPath(command, "--save-map", request.save_map, "write the map to this file instead of OUT/map.tutti");
  command.add_flag(
      "--dense", arguments->dense,
      "at the end make a mesh of the depth or stereo images, with the corrected poses (OUT/mesh.ply, voxels "
      "of 2 cm); `tutti dense OUT` makes it with other options, clouds and grids");
  AddOption(
      command, "--checkpoint", arguments->checkpoint_s,
      "while running, write OUT/checkpoint.tutti at most every SECONDS (default 30), from which --resume "
      "goes on after a crash",
      NotNegative())
      ->expected(0, 1)
      ->type_name("SECONDS");
  command.add_option("--resume", arguments->resume,
                     "OUT: go on with the run in this folder that was broken off, from its last checkpoint; "
                     "the results are those of a run that never stopped. Needs no other option");
  AddPath(command, "--ground-truth", request.ground_truth,
          "trajectory to evaluate against (default: the data set's own, if it has one; 'none': don't)");
  command.add_option(
      "--set", arguments->set,
      "SECTION.KEY=VALUE: any key of --help-config --advanced, on top of the file (loops.rule=orb, "
      "odometry.features=900, loops.extraction.features=300); may be given several times");
  command.add_flag("--no-loops", request.no_loops, "odometry alone");
  command.add_flag("--no-imu", request.no_imu, "leave an IMU that lies beside the images out");
  AddSeed(command, request.seed);
  AddThreads(command, request.threads);
  AddOption(
      command, "--inject-false-loops", request.inject_false_loops,
      "test of the back end: add so many false loops (random relative poses, wrong places, pairs that "
      "agree with each other) that look verified; loops.csv says what became of each (injected, reason, "
      "weight)",
      NotNegative());
  AddStart(command, "frame", request.start);
  AddOption(command, "--end", request.end, "frame before which to stop (--end 600: frames 0 to 599)",
            Positive());
  AddOption(command, "--stride", request.stride, "use every so many frames, from the first on", Positive());
  AddOption(command, "--follow", arguments->follow_s,
            "the folder is still being written to: wait for new images, and end when none came for SECONDS "
            "(default 10), or with Ctrl-C",
            Positive())
      ->expected(0, 1)
      ->type_name("SECONDS");
  command.add_flag(
      "--realtime", request.realtime,
      "play by the time stamps and drop the frames that it can't follow; without it every frame is "
      "processed, and the result does not depend on the machine's speed");
  AddViewOptions(command, arguments->view);
  command.add_flag("--timing", request.timing,
                   "print how long each stage took: calls, median, p99, total, share");
  AddPath(command, "--trace", request.trace,
          "write the times of all stages to this file; open it in ui.perfetto.dev or chrome://tracing");
  AddOutcomeOptions(command, arguments->outcome);
  command.add_flag("--help-config", arguments->help_config,
                   "print the keys of the configuration that users set, with their defaults");
  command.add_flag("--advanced", arguments->advanced, "with --help-config: all keys");
  command.callback([&command, arguments, &exit_code] { exit_code = RunOnce(command, *arguments); });
}

}  // namespace tutti::cli
