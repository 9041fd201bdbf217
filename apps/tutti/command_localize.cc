// tutti localize: where the frames of a data set are in a map.
#include <cstdio>
#include <memory>
#include <string>

#include "apps/run/localization.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/recording_options.h"
#include "core/terminal.h"
#include "tutti/slam/config.h"
#include "tutti/slam/map_file.h"

namespace tutti::cli {
namespace {

struct LocalizeArguments {
  LocalizationRequest request;  // what the options say of it themselves
  std::string dataset, config, mask;
  CameraRequest camera;
  ViewOptions view;
};

// 130: ended by Ctrl-C; 1: no frame was found in the map.
int RunLocalize(const CLI::App& command, const LocalizeArguments& arguments) {
  LocalizationRequest request = arguments.request;
  request.dataset = arguments.dataset;
  if (request.out.empty()) request.out = DefaultOutput(arguments.dataset, "-localized");
  if (!arguments.mask.empty()) request.mask = arguments.mask;
  if (!arguments.config.empty() || arguments.camera.HasLens() || arguments.camera.sensor) {
    RunConfig config;
    if (arguments.config.empty())
      config.dataset = ForAnotherRecording(ReadMapInfo(request.map).config.dataset);
    else
      config = LoadConfig(arguments.config);
    SetCamera(arguments.dataset, arguments.camera, config);
    request.options = config.dataset;
  }
  StartView(command, arguments.view, request.quiet, request.observers);
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
  LocalizationRequest& request = arguments->request;
  command.add_option("--map", request.map, "map.tutti of a run; it is only read")->required();
  command
      .add_option("dataset,--dataset", arguments->dataset,
                  "the recording, as for `tutti run`, of the same camera")
      ->required();
  command.add_option("--out", request.out,
                     "folder for the results (default: tutti-out/NAME-localized): a new or empty one, or an "
                     "earlier one's");
  command.add_option("--config", arguments->config,
                     "YAML file that says how to read the data set (sections dataset and camera); without "
                     "it, as the map's was read");
  AddCameraOptions(command, arguments->camera);
  AddMaskOption(command, arguments->mask);
  AddStart(command, "frame", request.start);
  AddEndAndStride(command, "frame", request.end, request.stride);
  AddThreads(command, request.threads);
  AddViewOptions(command, arguments->view);
  command.add_flag("--quiet", request.quiet, "no progress and no notes");
  command.callback([&command, arguments, &exit_code] { exit_code = RunLocalize(command, *arguments); });
}

}  // namespace tutti::cli
