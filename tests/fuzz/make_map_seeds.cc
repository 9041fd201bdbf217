// Seeds for map_fuzzer: tutti_make_map_seeds FOLDER saves small maps there, in its format.
#include <filesystem>
#include <string>

#include "apps/slam/map_parts.h"
#include "tests/fuzz/sections.h"
#include "tests/fuzz/seed_file.h"
#include "tests/fuzz/tiny_map.h"
#include "tutti/slam/slam_system.h"

int main(int argc, char** argv) {
  const std::filesystem::path folder = tutti::fuzz::SeedFolder(argc, argv);
  const tutti::testing::Recording drive = tutti::fuzz::TinyDrive(6);
  tutti::SlamSystem slam(tutti::fuzz::TinyConfig(), drive.rig);
  for (const tutti::InputFrame& frame : drive.frames) {
    const std::filesystem::path saved = folder / "saved";
    slam.Track(frame);
    slam.Snapshot().Write(saved);
    tutti::fuzz::WriteSeed(folder / std::to_string(frame.index),
                           tutti::fuzz::SectionsOf(saved, tutti::kMapFile, tutti::internal::kEndOfSections));
    std::filesystem::remove(saved);
  }
  return 0;
}
