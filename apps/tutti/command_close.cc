// tutti close: loops and a corrected trajectory for another odometry.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/run/outputs.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/recording_options.h"
#include "apps/tutti/run_with_report.h"
#include "core/terminal.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"
#include "tutti/slam/config.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct CloseArguments {
  RunRequest request;  // what the options say of it themselves
  GivenOdometryFiles odometry;
  std::string images, config, mask;
  CameraRequest camera;
  std::vector<std::string> sigma;  // share of the way and degrees, or a file
  std::vector<std::string> set;    // SECTION.KEY=VALUE
  OutcomeOptions outcome;
};

// From a file, or from what the recording is. Where nothing says what the camera is, it is not guessed: loops
// then have no poses.
RunConfig CameraAndMore(const CloseArguments& arguments) {
  if (!arguments.config.empty()) {
    RunConfig config = LoadConfig(arguments.config);
    SetCamera(arguments.images, arguments.camera, config);
    return config;
  }
  const Recording recording = Recognise(arguments.images, arguments.camera);
  if (recording.guessed_lens) {
    RunConfig config;
    SetCamera(arguments.images, arguments.camera, config);
    return config;
  }
  if (!arguments.outcome.quiet) SayFindings(recording);
  return recording.config;
}

RunConfig ConfigOf(const CloseArguments& arguments) {
  RunConfig config = CameraAndMore(arguments);
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

int Close(const CloseArguments& arguments) {
  RunRequest request = arguments.request;
  request.config = arguments.config.empty() ? "(defaults)" : arguments.config;
  request.dataset = arguments.images;
  if (request.out.empty()) request.out = DefaultOutput(arguments.images, "-closed");
  request.quiet = arguments.outcome.quiet;
  request.odometry = arguments.odometry;
  if (arguments.sigma.size() == 1) request.odometry->sigmas = arguments.sigma[0];
  RefuseToReplace(request.out, arguments.odometry.trajectory);
  OutputFolder::Check(request.out, RunLayout());
  const RunResult result = RunAndPrint(request, ConfigOf(arguments), arguments.outcome);
  std::printf("\n  results are in %s\n", internal::Printable(result.folder.string()).c_str());
  if (result.appearance_only && !request.quiet)
    internal::Say(
        "without a calibration (--config with camera: fx, fy, cx, cy) loops have no poses: there are "
        "loops.csv and summary.json, but no corrected trajectory and no graph");
  return Conclude(result, arguments.outcome);
}

}  // namespace

void SetUpClose(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<CloseArguments>();
  RunRequest& request = arguments->request;
  GivenOdometryFiles& odometry = arguments->odometry;
  command
      .add_option("--trajectory", odometry.trajectory,
                  "poses of the odometry, in metres: TUM 'stamp x y z qx qy qz qw', KITTI or EuRoC")
      ->required();
  command
      .add_option("--images", arguments->images,
                  "what the camera saw along it: a folder of images, a data set (KITTI, TUM, EuRoC; with "
                  "depth or right images distances are measured), a video, or a bag of ROS 1 or 2")
      ->required();
  AddPath(command, "--depth", odometry.depth,
          "folder of depth images, registered to those of --images, if that is a plain folder: in the same "
          "order if there are as many, else by the time stamps that they are called by");
  command.add_option("--config", arguments->config,
                     "YAML file; without it, layout, sensor and calibration are found in --images, and what "
                     "was found is said. Where there is no calibration, there is loops.csv alone");
  AddCameraOptions(command, arguments->camera);
  AddMaskOption(command, arguments->mask);
  command.add_option("--out", request.out,
                     "folder for the results, as of `tutti run` (default: tutti-out/NAME-closed)");
  AddDefaulted(command, "--format", odometry.format, "of --trajectory; auto: by content",
               CLI::IsMember({"auto", "tum", "kitti", "euroc"}));
  AddPath(
      command, "--times", odometry.times,
      "time stamps [s], one a line: of the images (default: times.txt in the folder or above it, else the "
      "file names, else the poses by order), or of the poses of a KITTI file");
  command
      .add_option("--odometry-sigma", arguments->sigma,
                  "FRACTION DEG: standard deviation of the odometry between two keyframes, as a share of the "
                  "way and as an angle (run.odometry_sigma_fraction, run.odometry_sigma_deg); or a FILE with "
                  "a line for each pose: standard deviations of the motion since the pose before, in metres "
                  "and degrees on each axis (a TUM file may have these as columns 9 and 10)")
      ->expected(1, 2);
  AddPath(command, "--ground-truth", request.ground_truth,
          "trajectory to evaluate against (default: the data set's own; 'none': don't)");
  command.add_option("--set", arguments->set, "SECTION.KEY=VALUE, as of `tutti run`");
  AddSeed(command, request.seed);
  AddThreads(command, request.threads);
  AddStart(command, "image", request.start);
  AddEndAndStride(command, "image", request.end, request.stride);
  command.add_flag("--keep", request.keep, "don't replace earlier results in --out: number them");
  AddOutcomeOptions(command, arguments->outcome);
  command.callback([arguments, &exit_code] { exit_code = Close(*arguments); });
}

}  // namespace tutti::cli
