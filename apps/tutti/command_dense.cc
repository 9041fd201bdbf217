// tutti dense: surfaces and free space, from a map and the recording that it was made of.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "apps/reconstruct/reconstruction.h"
#include "apps/run/outputs.h"
#include "apps/tutti/commands.h"
#include "apps/tutti/files.h"
#include "apps/tutti/options.h"
#include "apps/tutti/recording_options.h"
#include "apps/tutti/saved_map.h"
#include "core/terminal.h"
#include "tutti/core/error.h"

namespace tutti::cli {
namespace {

struct DenseArguments {
  std::string map, dataset;
  int session = 0;  // counted from 1; 0: none was chosen
  ReconstructionRequest request;
};

void PrintReconstruction(const Reconstruction& made) {
  SayWarnings(made.warnings);
  const DenseReport& dense = made.dense;
  std::printf("%zu of %zu frames integrated, %zu skipped; %.0f MB of voxels\n", dense.integrated, made.frames,
              dense.skipped, dense.memory_mb);
  for (const ExportedFile& written : made.files) {
    std::printf("%s: %s\n  open with: %s\n", internal::Printable(written.path.string()).c_str(),
                written.content.c_str(), internal::Printable(written.open_with).c_str());
  }
}

int RunDense(const DenseArguments& arguments) {
  ReconstructionRequest request = arguments.request;
  const std::filesystem::path file = MapFile(arguments.map);
  for (const auto& out : {request.mesh, request.cloud, request.octomap, request.esdf})
    KeepInputs({file}, {out.value_or("")});
  CheckReconstruction(request);
  const SavedMap map = ReadSavedMap(file, arguments.session, SessionFrames::kOfSession);
  const std::unique_ptr<Dataset> dataset = OpenRecording(map, arguments.dataset);
  if (dataset == nullptr)
    throw InputError(file.string() +
                     ": does not say where its images are, or they came from a camera; give DATASET");
  // The report of the run that the map lies beside shows it, too.
  if (file.filename() == kMap) request.report = file.parent_path();
  const Reconstruction made = Reconstruct(map.model, *dataset, request);
  PrintReconstruction(made);
  if (!made.interrupted) return 0;
  internal::Say("interrupted; the files have what was integrated by then");
  return 130;
}

}  // namespace

void SetUpDense(CLI::App& command, int& exit_code) {
  const auto arguments = std::make_shared<DenseArguments>();
  ReconstructionRequest& request = arguments->request;
  request.dense.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  command.add_option("MAP", arguments->map, "folder of `tutti run`, or a map file (map.tutti)")->required();
  command.add_option("DATASET", arguments->dataset, "where the recording is now (default: where it was)");
  AddPath(command, "--mesh", request.mesh, "surface with colours and normals (PLY)")->type_name("FILE");
  AddPath(command, "--cloud", request.cloud,
          "points of the surface, one a voxel, with colours and normals (PLY)")
      ->type_name("FILE");
  AddPath(command, "--grid", request.grid,
          "2D occupancy grid: DIR/map.pgm and DIR/map.yaml, as ROS's map_server reads them")
      ->type_name("DIR");
  AddPath(command, "--octomap", request.octomap, "free and occupied space in 3D (OctoMap's .bt)")
      ->type_name("FILE");
  AddPath(command, "--esdf", request.esdf, "distance to the nearest obstacle in 3D (OpenVDB's .vdb)")
      ->type_name("FILE");
  AddDefaulted(
      command, "--voxel", request.dense.voxel_m,
      "edge of a voxel [m]: half of it takes four times the memory and the time; the noise of a Kinect is "
      "worth 0.01 to 0.02 in a room, of a stereo camera 0.1 in a street",
      Positive());
  AddWord(command, "--frames", request.frames,
          "all that have a pose (default), or keyframes: faster, with fewer views of each surface",
          WordsOf(DenseFrames{}));
  AddDefaulted(
      command, "--min-frames", request.dense.min_frames,
      "a surface is there where so many frames measured it; fewer: more surface and more that is none",
      CLI::Range(1, 1000));
  AddOption(command, "--max-depth", request.dense.max_depth_m,
            "farther depth is not used [m] (default: all is used; of a stereo camera up to 40 "
            "baselines)",
            Positive());
  AddPath(command, "--depth", request.depth,
          "for one camera: folder with a depth image for each image of the recording, in the order of their "
          "names, as "
          "a network makes them (16 bit PNG, or float TIFF; of the images' size, in any unit: landmarks give "
          "the scale)")
      ->type_name("DIR");
  AddDefaulted(command, "--robot-height", request.robot_height_m,
               "--grid: obstacles between 0.1 m and this height above the ground count [m]", Positive());
  AddDefaulted(command, "--cell", request.dense.cell_m,
               "edge of a cell of --grid, --octomap and --esdf [m]; 0: 0.05, but at least 2.5 voxels",
               NotNegative());
  AddDefaulted(
      command, "--memory", request.dense.memory_mb,
      "voxels take at most so much [MB]; what is new after that is left out, and said. A room needs about "
      "100 at 0.02 m",
      Positive());
  AddOption(command, "--session", arguments->session,
            "of a map that several recordings made: the one that is used (counted from 1; default: the last)",
            Positive());
  AddThreads(command, request.dense.threads);
  command.add_flag("--quiet", request.quiet, "no progress");
  command.footer(
      "Depth comes from an RGB-D camera, a stereo camera, or --depth. Poses are those after the last\n"
      "correction, so loops are closed. Axes, units and programs: docs/dense.md.\n"
      "Ctrl-C writes the files with what was integrated by then.\n"
      "Examples:\n"
      "  tutti dense result --mesh kitchen.ply\n"
      "  tutti dense result --voxel 0.01 --mesh fine.ply --cloud points.ply\n"
      "  tutti dense result --grid navigation --robot-height 0.4 --octomap space.bt\n"
      "  tutti dense result /data/street --voxel 0.1 --max-depth 20 --mesh street.ply");
  command.callback([arguments, &exit_code] { exit_code = RunDense(*arguments); });
}

}  // namespace tutti::cli
