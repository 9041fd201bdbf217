// Example 09: a mesh and a grid to navigate in, from depth images whose poses are known: of tutti, or of any
// other program.
//
//   09_dense_map [CONFIG.yaml FOLDER TRAJECTORY.txt MESH.ply GRID]
//
// Poses are T_world_body in TUM's format. Without arguments it takes a generated room.
//
//   find_package(tutti REQUIRED COMPONENTS dense)                     # reading data sets: COMPONENTS slam,
//   too target_link_libraries(my_robot PRIVATE tutti::dense)
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <string>

#include "tutti/core/trajectory.h"
#include "tutti/dense/dense_files.h"
#include "tutti/dense/dense_map.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/config.h"
#include "world.h"

namespace {

int Run(const std::string& config_file, const std::string& folder, const std::string& trajectory_file,
        const std::string& mesh_file, const std::string& grid_folder) {
  const tutti::RunConfig config = tutti::LoadConfig(config_file);
  const std::unique_ptr<tutti::Dataset> dataset = tutti::OpenDataset(folder, config.dataset);
  const tutti::CameraRig& rig = dataset->Rig();
  tutti::DenseOptions options;
  options.voxel_m = 0.02;
  tutti::DenseMap map(options);
  for (const tutti::StampedPose& pose :
       tutti::ReadTrajectory(trajectory_file, tutti::TrajectoryFormat::kTum)) {
    const std::optional<std::size_t> place = tutti::FindStamp(*dataset, pose.stamp_s);
    if (!place) continue;
    const tutti::ReadResult read = dataset->Read(*place);
    if (!read.frame) continue;
    const cv::Mat colours = dataset->ReadColour(*place).image;
    const std::string problem =
        map.Integrate(read.frame->depth_m, colours, pose.pose * rig.T_body_camera, rig.camera);
    if (!problem.empty()) std::printf("frame %zu is skipped: %s\n", *place, problem.c_str());
  }
  const tutti::TriangleMesh mesh = map.Mesh();
  tutti::WritePly(mesh_file, mesh);
  tutti::WriteGrid(grid_folder, map.Grid());
  std::printf("%zu frames, %zu triangles, %.0f MB of voxels\n", map.Report().integrated,
              mesh.triangles.size(), map.Report().memory_mb);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 1 && argc != 6) {
    std::fprintf(stderr, "usage: %s [CONFIG.yaml FOLDER TRAJECTORY.txt MESH.ply GRID]\n", argv[0]);
    return 1;
  }
  try {
    if (argc > 1) return Run(argv[1], argv[2], argv[3], argv[4], argv[5]);
    const std::string room = examples::World(
        argv[0], "room", "--world room --sensor rgbd --laps 1 --rate 5 --width 320 --height 240");
    return Run(room + "/config.yaml", room, room + "/groundtruth.txt", "example_world/mesh.ply",
               "example_world/grid");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
