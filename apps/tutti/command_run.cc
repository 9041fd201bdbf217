// tutti run: SLAM on a data set.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "apps/report/page.h"
#include "apps/run/focal_length.h"
#include "apps/run/outputs.h"
#include "apps/run/recording.h"
#include "apps/run/runner.h"
#include "apps/tutti/camera_options.h"
#include "apps/tutti/checks.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/configuration_of.h"
#include "apps/tutti/exit_code.h"
#include "apps/tutti/files.h"
#include "apps/tutti/mask_option.h"
#include "apps/tutti/run_with_report.h"
#include "apps/tutti/view_options.h"
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
  std::string config, dataset, out, ground_truth;
  std::string trace, resume, map, save_map;
  std::string mask, require = "doubtful";
  CameraWords camera;
  int rotate = 0;
  std::vector<std::string> set;  // SECTION.KEY=VALUE
  bool no_loops = false, no_report = false, quiet = false, keep = false, help_config = false,
       advanced = false, timing = false, realtime = false, no_map = false;
  std::uint64_t seed = 1;
  int threads = 2;
  int inject_false_loops = 0;
  int start = 0, end = 0, stride = 1;
  double follow_s = 10, checkpoint_s = 30;
  ViewOptions view;
};

int RunAndShow(const RunArguments& arguments, RunRequest request, const RunConfig& config) {
  const RunResult result = arguments.no_report ? RunSlam(request, config) : RunWithReport(request, config);
  std::fputs(internal::Message(ResultTable(result), stdout, internal::Breaks::kAll).c_str(), stdout);
  if (arguments.timing) {
    std::fputs(TimingTable(result.stages, result.wall_s, result.cpu_s, result.frames_total).c_str(), stdout);
    if (result.odometry_alone_cpu_s > 0)
      std::printf("  the odometry without loops: %.1f s more\n", result.odometry_alone_cpu_s);
  }
  std::printf("\n  results are in %s\n", internal::Printable(result.folder.string()).c_str());
  const fs::path report = fs::path(result.folder) / "report.html";
  std::error_code ignored;
  if (!arguments.no_report && fs::exists(report, ignored))
    std::printf("  look at %s\n", internal::Printable(fs::absolute(report, ignored).string()).c_str());
  if (!arguments.no_report && !arguments.quiet && !ReportsAvailable())
    internal::Say("%s", ReportsMissing().c_str());
  return ExitCode(result, arguments.require);
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
  const auto keep = [&](const std::string& file, bool said, const char* option) {
    if (file.empty() || said || arguments.quiet) return;
    internal::Say("the run also wrote %s; to have it written again, give %s%s", file.c_str(), option,
                  file.c_str());
  };
  keep(map, !arguments.save_map.empty() || arguments.no_map, "--save-map ");
  keep(ltm_file, !arguments.set.empty(), "--set loops.ltm_file=");
  SetOptions(arguments.set, config);
  request.quiet = arguments.quiet;
  request.timing = arguments.timing;
  if (!arguments.trace.empty()) request.trace = arguments.trace;
  if (command.count("--threads") > 0) request.threads = arguments.threads;
  if (command.count("--checkpoint") > 0) request.checkpoint_s = arguments.checkpoint_s;
  if (!arguments.save_map.empty()) request.save_map = arguments.save_map;
  if (arguments.no_map) request.save_map.reset();
  if (auto view = StartView(command, arguments.view, arguments.quiet))
    request.observers.push_back(std::move(view));
  return RunAndShow(arguments, std::move(request), config);
}

// What the map was made with, for a recording of which all frames are used.
RunConfig ConfigOfMap(const std::string& map) {
  RunConfig config = ReadMapInfo(map).config;
  config.dataset = ForAnotherRecording(config.dataset);
  return config;
}

std::string Pixels(double focal_px) {
  char text[40];
  std::snprintf(text, sizeof text, "%.1f px", focal_px);
  return text;
}

void SetImageUse(const RunArguments& arguments, DatasetOptions& options) {
  SetMask(arguments.mask, options);
  if (arguments.rotate != 0) options.rotate = arguments.rotate;
}

// Where nothing says what the focal length is, the images may.
void MeasureGuess(const RunArguments& arguments, Recording& recording, RunRequest& request) {
  const auto say = [&](const std::string& text) {
    if (!arguments.quiet)
      std::fputs(internal::Message("  camera  " + text).c_str(), internal::StandardError());
  };
  say("measuring the focal length on the first frames ...");
  RunConfig range = recording.config;
  if (request.start) range.dataset.start = *request.start;
  if (request.end) range.dataset.end = *request.end;
  if (request.stride) range.dataset.stride = *request.stride;
  const FocalLength found = MeasureFocalLength(arguments.dataset, range);
  request.focal_length = found;
  char text[200];
  if (found.measured) {
    recording.config.dataset.camera = found.camera;
    std::snprintf(text, sizeof text, "focal length measured on %d frames: %.1f px, give or take %.1f %%",
                  found.frames, found.camera.fx, 100 * found.sigma);
  } else {
    request.camera_guessed = recording.photo_lens.empty();
    const std::string source =
        request.camera_guessed ? "guessed, " + Pixels(found.camera.fx) : recording.photo_lens;
    std::snprintf(text, sizeof text, "focal length %s: in the first %d frames %s", source.c_str(),
                  found.frames, found.reason.c_str());
  }
  request.camera_source = text;
  say(text);
}

// From a file, or from the map to go on in, or from what the recording is.
RunConfig ConfigFor(const CameraRequest& camera, const RunArguments& arguments, RunRequest& request) {
  if (!arguments.config.empty() || !arguments.map.empty()) {
    RunConfig config = arguments.config.empty() ? ConfigOfMap(arguments.map) : LoadConfig(arguments.config);
    SetCamera(arguments.dataset, camera, config);
    SetImageUse(arguments, config.dataset);
    return config;
  }
  RunConfig asked;
  SetOptions(arguments.set, asked);
  CameraRequest wanted = camera;
  wanted.depth_units_per_m = asked.dataset.depth_units_per_m;
  Recording recording = Recognise(arguments.dataset, wanted);
  if (!arguments.quiet) SayFindings(recording);
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

fs::path OutputOf(const RunArguments& arguments) {
  if (!arguments.out.empty()) return arguments.out;
  return DefaultOutput(IsCamera(arguments.dataset) ? "camera" : arguments.dataset);
}

// Before the images are read, to measure a focal length for example. A file in --out has its folder later.
void CheckFiles(const RunRequest& request) {
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
  RunRequest request;
  request.config = arguments.config;
  request.dataset = arguments.dataset;
  request.out = OutputOf(arguments);
  request.no_loops = arguments.no_loops;
  request.quiet = arguments.quiet;
  request.keep = arguments.keep;
  if (command.count("--follow") > 0) request.follow_s = arguments.follow_s;
  // A camera does not wait.
  request.realtime = arguments.realtime || IsCameraDevice(arguments.dataset);
  request.timing = arguments.timing;
  if (!arguments.trace.empty()) request.trace = arguments.trace;
  if (!arguments.ground_truth.empty()) request.ground_truth = arguments.ground_truth;
  if (command.count("--seed") > 0) request.seed = arguments.seed;
  if (command.count("--threads") > 0) request.threads = arguments.threads;
  if (command.count("--inject-false-loops") > 0) request.inject_false_loops = arguments.inject_false_loops;
  if (command.count("--start") > 0) request.start = arguments.start;
  if (command.count("--end") > 0) request.end = arguments.end;
  if (command.count("--stride") > 0) request.stride = arguments.stride;
  if (command.count("--checkpoint") > 0) request.checkpoint_s = arguments.checkpoint_s;
  if (request.checkpoint_s && request.realtime)
    throw InputError("run: --checkpoint: in real time, or with a camera, there is no going on later");
  if (!arguments.save_map.empty()) request.save_map = arguments.save_map;
  if (arguments.save_map.empty() && !arguments.no_map) request.save_map = kMap;
  if (!arguments.map.empty()) request.map = arguments.map;
  CheckFiles(request);
  if (auto view = StartView(command, arguments.view, arguments.quiet))
    request.observers.push_back(std::move(view));
  RunConfig config = ConfigFor(CameraOf(command, arguments.camera), arguments, request);
  SetOptions(arguments.set, config);
  return RunAndShow(arguments, std::move(request), config);
}

}  // namespace

void SetUpRun(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<RunArguments>();
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
  command
      .add_option("--rotate", arguments->rotate,
                  "turn the images so far clockwise, so that they are upright; the camera is given as it is, "
                  "before that, and is turned with them. Not for stereo")
      ->check(OneOf({"90", "180", "270"}));
  command.add_option("--out", arguments->out,
                     "folder for the results (default: tutti-out/NAME): a new or empty one, or that of an "
                     "earlier run, whose results are replaced when the new ones are complete");
  command.add_flag(
      "--keep", arguments->keep,
      "don't replace earlier results in --out: move them into OUT/1, the next ones into OUT/2, ...");
  command.add_option("--map", arguments->map,
                     "map.tutti of an earlier run: go on in it, as another session; the map that is written "
                     "holds both. Without --config, the map's configuration is used");
  command.add_flag("--no-map", arguments->no_map, "don't write the map (OUT/map.tutti)");
  command.add_option("--save-map", arguments->save_map,
                     "write the map to this file instead of OUT/map.tutti");
  command
      .add_option("--checkpoint", arguments->checkpoint_s,
                  "while running, write OUT/checkpoint.tutti at most every SECONDS (default 30), from which "
                  "--resume goes on after a crash")
      ->expected(0, 1)
      ->type_name("SECONDS")
      ->check(NotNegative());
  command.add_option("--resume", arguments->resume,
                     "OUT: go on with the run in this folder that was broken off, from its last checkpoint; "
                     "the results are those of a run that never stopped. Needs no other option");
  command.add_option(
      "--ground-truth", arguments->ground_truth,
      "trajectory to evaluate against (default: the data set's own, if it has one; 'none': don't)");
  command.add_option(
      "--set", arguments->set,
      "SECTION.KEY=VALUE: any key of --help-config --advanced, on top of the file (loops.rule=orb, "
      "odometry.features=900, loops.extraction.features=300); may be given several times");
  command.add_flag("--no-loops", arguments->no_loops, "odometry alone");
  command.add_option("--seed", arguments->seed, "of everything that draws random numbers")
      ->check(NotNegative());
  command.add_option("--threads", arguments->threads, "most threads; the result is the same for any number")
      ->check(Positive());
  command
      .add_option(
          "--inject-false-loops", arguments->inject_false_loops,
          "test of the back end: add so many false loops (random relative poses, wrong places, pairs that "
          "agree with each other) that look verified; loops.csv says what became of each (injected, reason, "
          "weight)")
      ->check(NotNegative());
  command.add_option("--start", arguments->start, "first frame that is used, counted from 0")
      ->check(NotNegative());
  command.add_option("--end", arguments->end, "frame before which to stop (--end 600: frames 0 to 599)")
      ->check(Positive());
  command.add_option("--stride", arguments->stride, "use every so many frames, from the first on")
      ->check(Positive());
  command
      .add_option(
          "--follow", arguments->follow_s,
          "the folder is still being written to: wait for new images, and end when none came for SECONDS "
          "(default 10), or with Ctrl-C")
      ->expected(0, 1)
      ->type_name("SECONDS")
      ->check(Positive());
  command.add_flag(
      "--realtime", arguments->realtime,
      "play by the time stamps and drop the frames that it can't follow; without it every frame is "
      "processed, and the result does not depend on the machine's speed");
  AddViewOptions(command, arguments->view);
  command.add_flag("--timing", arguments->timing,
                   "print how long each stage took: calls, median, p99, total, share");
  command.add_option(
      "--trace", arguments->trace,
      "write the times of all stages to this file; open it in ui.perfetto.dev or chrome://tracing");
  AddRequireOption(command, arguments->require);
  command.add_flag("--no-report", arguments->no_report, "no report.html and report.json");
  command.add_flag("--quiet", arguments->quiet, "no progress and no notes");
  command.add_flag("--help-config", arguments->help_config,
                   "print the keys of the configuration that users set, with their defaults");
  command.add_flag("--advanced", arguments->advanced, "with --help-config: all keys");
  command.callback([&command, arguments, &exit_code] { exit_code = RunOnce(command, *arguments); });
}

}  // namespace tutti::cli
