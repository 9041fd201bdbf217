// Saved maps: any sections under right checksums give a map that goes on and can be saved again, or an
// InputError.
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "apps/slam/map_parts.h"
#include "tests/fuzz/memory_file.h"
#include "tests/fuzz/sections.h"
#include "tests/fuzz/tiny_map.h"
#include "tutti/core/error.h"
#include "tutti/slam/slam_system.h"

namespace {

void GoOn(tutti::SlamSystem& slam, const tutti::MapInfo& info) {
  static const tutti::testing::Recording drive = tutti::fuzz::TinyDrive(1);
  constexpr std::int64_t kLastIndex = 1LL << 40;
  if (info.last_frame < 0 || info.last_frame > kLastIndex || info.rig.sensor != drive.rig.sensor) return;
  tutti::InputFrame frame = drive.frames[0];
  frame.index = info.last_frame + 1;
  frame.stamp_s = info.last_stamp_s + 10;
  slam.Track(frame);
  slam.Finish();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes = tutti::fuzz::FileOf(tutti::kMapFile, {reinterpret_cast<const char*>(data), size},
                                                {tutti::internal::kEndOfSections});
  const auto file =
      tutti::fuzz::MemoryFile(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  tutti::MapInfo info;
  std::unique_ptr<tutti::SlamSystem> slam;
  try {
    info = tutti::ReadMapInfo(file);
    info.config.run.threads = 1;
    slam = tutti::LoadMap(file, info);
    GoOn(*slam, info);
  } catch (const tutti::InputError&) {
    return 0;
  }
  static const std::filesystem::path again = tutti::fuzz::ScratchPath("map");
  slam->Snapshot().Write(again);
  try {
    tutti::LoadMap(again, tutti::ReadMapInfo(again));
  } catch (const tutti::InputError& error) {
    throw std::logic_error(error.what());  // what was saved must be loaded
  }
  std::filesystem::remove(again);
  return 0;
}
