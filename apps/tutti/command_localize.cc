// tutti localize: where the frames of a data set are in a map.
#include <cstdio>
#include <memory>
#include <string>

#include "apps/run/localization.h"
#include "apps/tutti/camera_options.h"
#include "apps/tutti/checks.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/mask_option.h"
#include "apps/tutti/view_options.h"
#include "core/terminal.h"
#include "tutti/slam/config.h"
#include "tutti/slam/map_file.h"

namespace tutti::cli {
namespace {

struct LocalizeArguments {
  std::string map, dataset, out, config, mask;
  CameraWords camera;
  int start = 0, end = 0, stride = 1, threads = 2;
  bool quiet = false;
  ViewOptions view;
};

// 130: ended by Ctrl-C; 1: no frame was found in the map.
int RunLocalize(const CLI::App& command, const LocalizeArguments& arguments) {
  LocalizationRequest request;
  request.map = arguments.map;
  request.dataset = arguments.dataset;
  request.out = arguments.out;
  if (arguments.out.empty()) request.out = DefaultOutput(arguments.dataset, "-localized");
  request.threads = arguments.threads;
  request.quiet = arguments.quiet;
  if (!arguments.mask.empty()) request.mask = arguments.mask;
  const CameraRequest camera = CameraOf(command, arguments.camera);
  if (!arguments.config.empty() || camera.HasLens() || camera.sensor) {
    RunConfig config;
    if (arguments.config.empty())
      config.dataset = ForAnotherRecording(ReadMapInfo(arguments.map).config.dataset);
    else
      config = LoadConfig(arguments.config);
    SetCamera(arguments.dataset, camera, config);
    request.options = config.dataset;
  }
  if (command.count("--start") > 0) request.start = arguments.start;
  if (command.count("--end") > 0) request.end = arguments.end;
  if (command.count("--stride") > 0) request.stride = arguments.stride;
  if (auto view = StartView(command, arguments.view, arguments.quiet))
    request.observers.push_back(std::move(view));
  const Localization result = Localize(request);
  const std::size_t total = result.frames.size() + result.bad;
  std::printf("\n  frames %zu of %zu localized", result.Localized(), total);
  if (result.masked && result.without_mask > 0) std::printf(", %zu without mask", result.without_mask);
  std::printf("; map loaded in %.2f s, ", result.load_s);
  if (result.first_pose_s) std::printf("first pose after %.2f s, ", *result.first_pose_s);
  std::printf("%.1f ms of processor time per frame\n",
              total > 0 ? 1000 * result.cpu_s / static_cast<double>(total) : 0.0);
  std::printf("  poses in the map's frame of reference are in %s\n  look at %s\n",
              (request.out / "trajectory.txt").c_str(), (request.out / "localization.svg").c_str());
  if (result.interrupted) return 130;
  if (result.Localized() > 0) return 0;
  internal::Say("not one frame was found in the map: it shows other places");
  return 1;
}

}  // namespace

void SetUpLocalize(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<LocalizeArguments>();
  command.add_option("--map", arguments->map, "map.tutti of a run; it is only read")->required();
  command
      .add_option("dataset,--dataset", arguments->dataset,
                  "the recording, as for `tutti run`, of the same camera")
      ->required();
  command.add_option("--out", arguments->out,
                     "folder for the results (default: tutti-out/NAME-localized): a new or empty one, or an "
                     "earlier one's");
  command.add_option(
      "--config", arguments->config,
      "YAML file that says how to read the data set (sections dataset and camera); without it, as "
      "the map's was read");
  AddCameraOptions(command, arguments->camera);
  AddMaskOption(command, arguments->mask);
  command.add_option("--start", arguments->start, "first frame that is used, counted from 0")
      ->check(NotNegative());
  command.add_option("--end", arguments->end, "frame before which to stop")->check(Positive());
  command.add_option("--stride", arguments->stride, "use every so many frames")->check(Positive());
  command.add_option("--threads", arguments->threads, "most threads; the result is the same for any number")
      ->check(Positive());
  AddViewOptions(command, arguments->view);
  command.add_flag("--quiet", arguments->quiet, "no progress and no notes");
  command.callback([&command, arguments, &exit_code] { exit_code = RunLocalize(command, *arguments); });
}

}  // namespace tutti::cli
