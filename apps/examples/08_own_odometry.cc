// Example 08: loops for the odometry that you already have. Poses come from a file here, as they would from
// your VIO, wheels or LiDAR; the correction comes out as a robot wants it (map -> odom, REP-105).
//
//   08_own_odometry [CONFIG.yaml FOLDER ODOMETRY.txt CORRECTED.txt]     # both in TUM format; without: a town
//
//   find_package(tutti REQUIRED COMPONENTS slam)
//   target_link_libraries(my_robot PRIVATE tutti::slam)
//
// Prints a line whenever loops move the map: the frame, and where the odometry's origin is then [m].
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <string>

#include "tutti/backend/evaluation.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/config.h"
#include "tutti/slam/trajectory_closer.h"
#include "world.h"

namespace {

int Run(const std::string& config_file, const std::string& folder, const std::string& odometry_file,
        const std::string& corrected_file) {
  const tutti::RunConfig config = tutti::LoadConfig(config_file);
  const std::unique_ptr<tutti::Dataset> dataset = tutti::OpenDataset(folder, config.dataset);
  const tutti::Trajectory odometry = tutti::ReadTrajectory(odometry_file, tutti::TrajectoryFormat::kTum);
  tutti::TrajectoryCloser closer(config, dataset->Rig());
  int corrections = 0;
  for (std::size_t i = 0; i < dataset->Size(); ++i) {
    const std::optional<tutti::Pose> T_odom_body = tutti::InterpolatePose(odometry, dataset->Stamp(i), 1.0);
    if (!T_odom_body) continue;  // the odometry does not know where this image was taken
    const tutti::ReadResult read = dataset->Read(i);
    if (!read.frame) continue;
    closer.Push(*read.frame, *T_odom_body);
    if (closer.Corrections() == corrections) continue;
    corrections = closer.Corrections();
    const Eigen::Vector3d origin = closer.T_map_odom().translation;
    std::printf("frame %zu: map -> odom is at %.3f %.3f %.3f\n", i, origin.x(), origin.y(), origin.z());
  }
  closer.Finish();  // what the loop detector is still at enters
  tutti::WriteTrajectory(corrected_file, closer.Corrected(odometry), tutti::TrajectoryFormat::kTum);
  std::printf("%zu keyframes, %zu loops, %d corrections\n", closer.Keyframes().size(),
              tutti::CountAccepted(closer.Loops()), closer.Corrections());
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 1 && argc != 5) {
    std::fprintf(stderr, "usage: %s [CONFIG.yaml FOLDER ODOMETRY.txt CORRECTED.txt]\n", argv[0]);
    return 1;
  }
  try {
    if (argc > 1) return Run(argv[1], argv[2], argv[3], argv[4]);
    const std::string town = examples::Town(argv[0], "stereo"), odometry = "example_world/odometry";
    examples::Tutti(argv[0], "run " + town + " --no-loops --no-report --quiet --out " + odometry);
    return Run(town + "/config.yaml", town, odometry + "/trajectory.txt", "example_world/corrected.txt");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
