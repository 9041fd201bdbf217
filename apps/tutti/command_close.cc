// tutti close: loops and a corrected trajectory for another odometry.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apps/report/page.h"
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
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/slam/config.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct CloseArguments {
  GivenOdometryFiles odometry;
  std::string trajectory, images, depth, times, config, out, ground_truth, mask, require = "doubtful";
  CameraWords camera;
  std::vector<std::string> sigma;  // share of the way and degrees, or a file
  std::vector<std::string> set;    // SECTION.KEY=VALUE
  std::uint64_t seed = 1;
  int threads = 2, start = 0, end = 0, stride = 1;
  bool keep = false, no_report = false, quiet = false;
};

// From a file, or from what the recording is. Where nothing says what the camera is, it is not guessed: loops
// then have no poses.
RunConfig CameraAndMore(const CameraRequest& camera, const CloseArguments& arguments) {
  if (!arguments.config.empty()) {
    RunConfig config = LoadConfig(arguments.config);
    SetCamera(arguments.images, camera, config);
    return config;
  }
  const Recording recording = Recognise(arguments.images, camera);
  if (recording.guessed_lens) {
    RunConfig config;
    SetCamera(arguments.images, camera, config);
    return config;
  }
  if (!arguments.quiet) SayFindings(recording);
  return recording.config;
}

RunConfig ConfigOf(const CameraRequest& camera, const CloseArguments& arguments) {
  RunConfig config = CameraAndMore(camera, arguments);
  if (arguments.sigma.size() == 2) {
    const std::optional<double> fraction = ParseDouble(arguments.sigma[0]),
                                deg = ParseDouble(arguments.sigma[1]);
    if (!fraction || !deg)
      throw InputError("--odometry-sigma: '" + arguments.sigma[fraction ? 1 : 0] +
                       "' is not a number; give FRACTION DEG, or one file");
    config.run.odometry_sigma_fraction = *fraction;
    config.run.odometry_sigma_deg = *deg;
    const std::string problem = config.run.Validate();
    if (!problem.empty()) throw InputError("--odometry-sigma: " + problem);
  }
  SetMask(arguments.mask, config.dataset);
  SetOptions(arguments.set, config);
  return config;
}

int Close(const CLI::App& command, const CloseArguments& arguments) {
  RunRequest request;
  request.config = arguments.config.empty() ? "(defaults)" : arguments.config;
  request.dataset = arguments.images;
  request.out = arguments.out.empty() ? DefaultOutput(arguments.images, "-closed") : fs::path(arguments.out);
  request.quiet = arguments.quiet;
  request.keep = arguments.keep;
  request.odometry = arguments.odometry;
  request.odometry->trajectory = arguments.trajectory;
  if (!arguments.depth.empty()) request.odometry->depth = arguments.depth;
  if (!arguments.times.empty()) request.odometry->times = arguments.times;
  if (arguments.sigma.size() == 1) request.odometry->sigmas = arguments.sigma[0];
  if (!arguments.ground_truth.empty()) request.ground_truth = arguments.ground_truth;
  if (command.count("--seed") > 0) request.seed = arguments.seed;
  if (command.count("--threads") > 0) request.threads = arguments.threads;
  if (command.count("--start") > 0) request.start = arguments.start;
  if (command.count("--end") > 0) request.end = arguments.end;
  if (command.count("--stride") > 0) request.stride = arguments.stride;
  RefuseToReplace(request.out, arguments.trajectory);
  OutputFolder::Check(request.out, RunLayout());
  const RunConfig config = ConfigOf(CameraOf(command, arguments.camera), arguments);
  const RunResult result = arguments.no_report ? RunSlam(request, config) : RunWithReport(request, config);
  std::fputs(internal::Message(ResultTable(result), stdout, internal::Breaks::kAll).c_str(), stdout);
  std::printf("\n  results are in %s\n", internal::Printable(result.folder.string()).c_str());
  if (result.appearance_only && !arguments.quiet)
    internal::Say(
        "without a calibration (--config with camera: fx, fy, cx, cy) loops have no poses: there are "
        "loops.csv and summary.json, but no corrected trajectory and no graph");
  if (!arguments.no_report && !arguments.quiet && !ReportsAvailable())
    internal::Say("%s", ReportsMissing().c_str());
  return ExitCode(result, arguments.require);
}

}  // namespace

void SetUpClose(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<CloseArguments>();
  command
      .add_option("--trajectory", arguments->trajectory,
                  "poses of the odometry, in metres: TUM 'stamp x y z qx qy qz qw', KITTI or EuRoC")
      ->required();
  command
      .add_option("--images", arguments->images,
                  "what the camera saw along it: a folder of images, a data set (KITTI, TUM, EuRoC; with "
                  "depth or right images distances are measured), a video, or a bag of ROS 1 or 2")
      ->required();
  command.add_option("--depth", arguments->depth,
                     "folder of depth images, registered to those of --images, if that is a plain folder: in "
                     "the same order if there are as many, else by the time stamps that they are called by");
  command.add_option(
      "--config", arguments->config,
      "YAML file; without it, layout, sensor and calibration are found in --images, and what was "
      "found is said. Where there is no calibration, there is loops.csv alone");
  AddCameraOptions(command, arguments->camera);
  AddMaskOption(command, arguments->mask);
  command.add_option("--out", arguments->out,
                     "folder for the results, as of `tutti run` (default: tutti-out/NAME-closed)");
  command.add_option("--format", arguments->odometry.format, "of --trajectory; auto: by content")
      ->check(CLI::IsMember({"auto", "tum", "kitti", "euroc"}))
      ->capture_default_str();
  command.add_option(
      "--times", arguments->times,
      "time stamps [s], one a line: of the images (default: times.txt in the folder or above it, else the "
      "file names, else the poses by order), or of the poses of a KITTI file");
  command
      .add_option(
          "--odometry-sigma", arguments->sigma,
          "FRACTION DEG: standard deviation of the odometry between two keyframes, as a share of the "
          "way and as an angle (run.odometry_sigma_fraction, run.odometry_sigma_deg); or a FILE with a "
          "line for each pose: standard deviations of the motion since the pose before, in metres and "
          "degrees on each axis (a TUM file may have these as columns 9 and 10)")
      ->expected(1, 2);
  command.add_option("--ground-truth", arguments->ground_truth,
                     "trajectory to evaluate against (default: the data set's own; 'none': don't)");
  command.add_option("--set", arguments->set, "SECTION.KEY=VALUE, as of `tutti run`");
  command.add_option("--seed", arguments->seed, "of everything that draws random numbers")
      ->check(NotNegative());
  command.add_option("--threads", arguments->threads, "most threads; the result is the same for any number")
      ->check(Positive());
  command.add_option("--start", arguments->start, "first image that is used, counted from 0")
      ->check(NotNegative());
  command.add_option("--end", arguments->end, "image before which to stop")->check(Positive());
  command.add_option("--stride", arguments->stride, "use every so many images")->check(Positive());
  command.add_flag("--keep", arguments->keep, "don't replace earlier results in --out: number them");
  AddRequireOption(command, arguments->require);
  command.add_flag("--no-report", arguments->no_report, "no report.html and report.json");
  command.add_flag("--quiet", arguments->quiet, "no progress and no notes");
  command.callback([&command, arguments, &exit_code] { exit_code = Close(command, *arguments); });
}

}  // namespace tutti::cli
