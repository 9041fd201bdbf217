// tutti export: a saved map in the formats of other programs.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>

#include "apps/export/map_export.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/options.h"
#include "apps/tutti/saved_map.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

namespace fs = std::filesystem;

struct ExportArguments {
  std::string map, dataset;
  int session = 0;  // counted from 1; 0: none was chosen
  ExportRequest request;
};

// Images are not needed for everything: where they can't be had, ExportMap says what it makes of that.
std::unique_ptr<Dataset> OpenImages(const ExportArguments& arguments, const SavedMap& map) {
  const ExportRequest& request = arguments.request;
  if (!request.landmarks && !request.colmap && !request.transforms) return nullptr;
  try {
    return OpenRecording(map, arguments.dataset);
  } catch (const InputError& error) {
    if (!arguments.dataset.empty() || request.colmap || request.transforms) throw;
    SayWarnings({error.what()});
    return nullptr;
  }
}

void RunExport(const ExportArguments& arguments) {
  const fs::path file = MapFile(arguments.map);
  const ExportRequest& wanted = arguments.request;
  for (const auto& out : {wanted.landmarks, wanted.transforms, wanted.g2o, wanted.tum})
    KeepInputs({file}, {out.value_or("")});
  for (const auto& out : {wanted.landmarks, wanted.g2o, wanted.tum}) CheckFiles({}, {out.value_or("")});
  SavedMap map = ReadSavedMap(file, arguments.session,
                              arguments.session > 0 ? SessionFrames::kOfSession : SessionFrames::kAll);
  const std::unique_ptr<Dataset> dataset = OpenImages(arguments, map);
  const ExportReport report = ExportMap(std::move(map.model), dataset.get(), arguments.request);
  SayWarnings(report.warnings);
  for (const ExportedFile& written : report.files) {
    std::printf("%s: %s\n  open with: %s\n", written.path.c_str(), written.content.c_str(),
                written.open_with.c_str());
  }
}

}  // namespace

void SetUpExport(CLI::App& command, int&) {
  const auto arguments = std::make_shared<ExportArguments>();
  ExportRequest& request = arguments->request;
  command.add_option("MAP", arguments->map, "folder of `tutti run`, or a map file (map.tutti)")->required();
  AddPath(command, "--landmarks", request.landmarks,
          "coloured landmarks with their number of observations, keyframes as pyramids (PLY)")
      ->type_name("FILE");
  AddPath(command, "--colmap", request.colmap,
          "COLMAP's sparse model, text and binary, in DIR/sparse/0, undistorted images in DIR/images")
      ->type_name("DIR");
  AddPath(command, "--transforms", request.transforms,
          "nerfstudio's DIR/transforms.json, with DIR/images and DIR/sparse_pc.ply beside it")
      ->type_name("FILE");
  AddPath(command, "--g2o", request.g2o, "pose graph: keyframes, odometry edges, accepted loops")
      ->type_name("FILE");
  AddPath(command, "--tum", request.tum, "poses of all frames, as in trajectory.txt")->type_name("FILE");
  AddDefaulted(
      command, "--images", request.images,
      "at most so many images for --colmap and --transforms, of the keyframes: evenly along the way, "
      "sharp ones first",
      CLI::Range(2, 1000000));
  command.add_option("--dataset", arguments->dataset, "where the images are now (default: where they were)")
      ->type_name("DIR");
  AddOption(command, "--session", arguments->session,
            "of a map that several recordings made: --tum has the frames of this one alone (counted from 1; "
            "default: all, in the order of their time stamps), and images are its (default: the last one's)",
            Positive());
  command.footer(
      "Poses are those after the last correction. Axes, units and programs: docs/formats.md.\n"
      "Surfaces, dense clouds and grids to navigate in: tutti dense.\n"
      "A folder must be new, empty, or of an earlier export, which is replaced; files are overwritten.\n"
      "Examples:\n"
      "  tutti export result --landmarks map.ply\n"
      "  tutti export result --colmap kitchen --transforms kitchen/transforms.json --images 200\n"
      "  tutti export result/map.tutti --g2o graph.g2o --tum trajectory.txt");
  command.callback([arguments] { RunExport(*arguments); });
}

}  // namespace tutti::cli
