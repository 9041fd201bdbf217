// Example 06: a map that outlives its run. Maps the first frames of a folder, saves the map, loads it again
// as another program would, and says where the other frames were taken.
//
//   06_map [CONFIG.yaml FOLDER FRAMES MAP.tutti]     # the first FRAMES frames are mapped
//
// Without arguments it takes a generated town.
//
//   find_package(tutti REQUIRED COMPONENTS slam)
//   target_link_libraries(my_robot PRIVATE tutti::slam)
//
// Prints a line for each other frame: its number, its position in the map [m], how many landmarks agree and
// how sure the position is; or why it has none.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <string>

#include "tutti/core/text.h"
#include "tutti/frontend/dataset.h"
#include "tutti/slam/config.h"
#include "tutti/slam/localizer.h"
#include "tutti/slam/map_file.h"
#include "tutti/slam/slam_system.h"
#include "world.h"

namespace {

// Runs SLAM on the frames before `end`, and saves what it knows then.
void MakeMap(const tutti::RunConfig& config, const tutti::Dataset& dataset, std::size_t end,
             const std::string& map) {
  tutti::SlamSystem slam(config, dataset.Rig());
  for (std::size_t i = 0; i < end; ++i) {
    const tutti::ReadResult read = dataset.Read(i);
    if (read.frame) slam.Track(*read.frame);  // else read.error says what is wrong with the file
  }
  slam.Finish();  // what the loop detector is still at enters the map
  slam.Snapshot().Write(map);
  std::printf("map of %zu frames: %zu keyframes, %zu loops\n", end,
              slam.odometry()->map().KeyframeIds().size(), tutti::CountAccepted(slam.loops()));
}

void PrintFrame(std::size_t i, const tutti::TrackResult& now, const tutti::Odometry& odometry) {
  if (now.state != tutti::TrackingState::kTracking) {
    std::printf("frame %zu: %s\n", i, now.reason.c_str());
    return;
  }
  const Eigen::Vector3d& p = now.T_world_camera.translation;
  std::printf("frame %zu: %.3f %.3f %.3f, %d landmarks", i, p.x(), p.y(), p.z(), now.inliers);
  if (const std::optional<tutti::Matrix6d> covariance = PoseCovariance(odometry))
    std::printf(", sigma %.3f", std::sqrt(covariance->topLeftCorner<3, 3>().trace()));
  // Where the map shows too little of what is in view, the odometry goes on by itself, and drifts.
  std::printf("%s\n", odometry.LastView().beyond_map ? " (beyond the map)" : "");
}

// Returns how many frames from `first` on were found in the map.
std::size_t Locate(const std::string& map, const tutti::Dataset& dataset, std::size_t first) {
  // What the map was made with (camera, configuration, counts) can be read without the map itself.
  const tutti::MapInfo info = tutti::ReadMapInfo(map);
  const std::unique_ptr<tutti::SlamSystem> slam = tutti::LoadMap(map, info);
  tutti::Localizer localizer(*slam);  // slam->Track would go on mapping
  std::size_t found = 0;
  for (std::size_t i = first; i < dataset.Size(); ++i) {
    const tutti::ReadResult read = dataset.Read(i);
    if (!read.frame) continue;
    const tutti::TrackResult now = localizer.Track(*read.frame);
    PrintFrame(i, now, localizer.odometry());
    found += now.state == tutti::TrackingState::kTracking ? 1 : 0;
  }
  std::printf("%zu of %zu frames are in the map\n", found, dataset.Size() - std::min(first, dataset.Size()));
  return found;
}

int Run(const std::string& config_file, const std::string& folder, std::size_t frames,
        const std::string& map) {
  const tutti::RunConfig config = tutti::LoadConfig(config_file);
  const std::unique_ptr<tutti::Dataset> dataset = tutti::OpenDataset(folder, config.dataset);
  MakeMap(config, *dataset, std::min(frames, dataset->Size()), map);
  return Locate(map, *dataset, frames) > 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  constexpr std::size_t kLap = 140;  // frames of the generated town
  const auto frames = argc == 5 ? tutti::ParseInteger(argv[3]) : std::nullopt;
  if (argc != 1 && (!frames || *frames < 1)) {
    std::fprintf(stderr, "usage: %s [CONFIG.yaml FOLDER FRAMES MAP.tutti]\n", argv[0]);
    return 1;
  }
  try {
    if (argc == 1) {
      const std::string town = examples::Town(argv[0], "stereo");
      return Run(town + "/config.yaml", town, kLap, "example_world/map.tutti");
    }
    return Run(argv[1], argv[2], static_cast<std::size_t>(*frames), argv[4]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
