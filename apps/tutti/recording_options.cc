#include "apps/tutti/recording_options.h"

#include <cstdio>
#include <filesystem>
#include <utility>

#include "core/camera_text.h"
#include "core/terminal.h"
#include "tutti/core/error.h"

namespace tutti::cli {

void AddCameraOptions(CLI::App& command, CameraRequest& camera) {
  AddPath(
      command, "--calibration", camera.calibration,
      "the camera from the file of another program: Kalibr, ORB-SLAM, stella_vslam, VINS, Basalt, OpenCV, "
      "ROS, EuRoC, KITTI, COLMAP, nerfstudio, Open3D, RealSense, ...; with --sensor stereo also the right "
      "one, where the file has it");
  command.add_option("--camera", camera.camera,
                     std::string("the camera as ") + internal::kCameraText + " in pixels");
  AddOption(command, "--fov", camera.view_deg,
            "the camera by its horizontal field of view [deg], principal point in the middle",
            NumberThat([](double v) { return v >= 5 && v <= 170; }, "from 5 to 170", "DEGREES"));
  AddWord(command, "--sensor", camera.sensor, "what to use of the recording; default: all that is there",
          WordsOf(Sensor()));
}

void SayFindings(const Recording& recording) {
  for (const std::string& finding : recording.findings)
    std::fputs(internal::Message("  " + finding).c_str(), internal::StandardError());
}

RunConfig ConfigurationOf(const std::string& config, const std::string& dataset,
                          const CameraRequest& camera) {
  if (!config.empty()) {
    RunConfig read = LoadConfig(config);
    SetCamera(dataset, camera, read);
    return read;
  }
  const Recording recording = Recognise(dataset, camera);
  if (recording.guessed_lens) {
    throw InputError(
        dataset +
        ": nothing here says what the camera is: give --calibration FILE, --camera or --fov, or put a "
        "calibration file into its folder (`tutti run` measures a focal length: camera_source in its "
        "summary.json)");
  }
  SayFindings(recording);
  return recording.config;
}

void AddMaskOption(CLI::App& command, std::string& mask) {
  command.add_option("--mask", mask,
                     "8-bit image as large as the camera's: where it is 0 (the robot's own body), the images "
                     "are not used; or a folder with such a mask for each image, of the image's name (for "
                     "what moves)");
}

void SetMask(const std::string& mask, DatasetOptions& options) {
  if (!mask.empty()) options.mask = std::filesystem::absolute(mask).lexically_normal().string();
}

void AddSeed(CLI::App& command, std::optional<std::uint64_t>& seed) {
  AddOption(command, "--seed", seed, "of everything that draws random numbers", NotNegative());
}

void AddStart(CLI::App& command, const std::string& what, std::optional<int>& start) {
  AddOption(command, "--start", start, "first " + what + " that is used, counted from 0", NotNegative());
}

void AddEndAndStride(CLI::App& command, const std::string& what, std::optional<int>& end,
                     std::optional<int>& stride) {
  AddOption(command, "--end", end, what + " before which to stop", Positive());
  AddOption(command, "--stride", stride, "use every so many " + what + "s", Positive());
}

void AddViewOptions(CLI::App& command, ViewOptions& options) {
  command.add_flag("--view", options.view,
                   "serve a page to look at it while it goes on, at 127.0.0.1 (through a tunnel: ssh -L "
                   "8077:127.0.0.1:8077 robot)");
  AddDefaulted(command, "--view-port", options.live.port, "of that page; 0: any free one",
               NumberThat([](double v) { return v >= 0 && v <= 65535; }, "of 0 to 65535", "0..65535"));
  command.add_option("--view-address", options.live.address,
                     "serve it at this address of the machine (0.0.0.0: all); the address that is printed "
                     "has a token, without which nothing is answered");
  AddDefaulted(command, "--view-wait", options.live.idle_s,
               "wait at most this long for a browser before the first frame [s]", NotNegative());
}

void StartView(const CLI::App& command, const ViewOptions& options, bool quiet,
               std::vector<std::shared_ptr<RunObserver>>& observers) {
  const bool address = command.count("--view-address") > 0;
  if (!options.view && !address) return;
  const std::string problem = options.live.Validate();
  if (!problem.empty()) throw InputError("--view: " + problem);
  LiveView view = OpenLiveView(options.live);
  const bool known = options.live.port != 0 && !address;  // as it was asked for
  if (!quiet || !known) internal::Say("look at %s", view.url.c_str());
  observers.push_back(std::move(view.observer));
}

}  // namespace tutti::cli
