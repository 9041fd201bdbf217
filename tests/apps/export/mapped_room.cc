#include "tests/apps/export/mapped_room.h"

#include <utility>

#include "tests/support/generated_dataset.h"
#include "tests/support/made_once.h"
#include "tutti/slam/map_file.h"

namespace tutti::testing {

MappedRoom MapOf(const std::filesystem::path& config_file, const std::filesystem::path& dataset, int frames) {
  RunConfig config = LoadConfig(config_file);
  config.dataset.end = frames;
  MappedRoom room;
  room.dataset = OpenDataset(dataset, config.dataset);
  room.slam = std::make_unique<SlamSystem>(config, room.dataset->Rig());
  for (std::size_t i = 0; i < room.dataset->Size(); ++i) {
    const ReadResult read = room.dataset->Read(i);
    if (read.frame) room.slam->Track(*read.frame);
  }
  room.slam->Finish();
  return room;
}

namespace {

SyntheticOptions RoomOf(int frames) {
  SyntheticOptions options;
  options.scene = SyntheticScene::kRoom;
  options.sensor = SyntheticSensor::kRgbd;
  options.frames = frames;
  return options;
}

// The map is in a file, as `tutti export` takes it.
MappedRoom LoadedRoom(int frames) {
  const std::filesystem::path data = GeneratedDataset(RoomOf(frames)), config = data / "config.yaml";
  const std::filesystem::path folder =
      MadeOnce("room-" + std::to_string(frames), "/proc/self/exe", [&](const std::filesystem::path& made) {
        std::filesystem::create_directories(made);
        MapOf(config, data, 0).slam->Snapshot().Write(made / "map.tutti");
      });
  const std::filesystem::path map = folder / "map.tutti";
  MappedRoom room;
  room.dataset = OpenDataset(data, LoadConfig(config).dataset);
  room.slam = LoadMap(map, ReadMapInfo(map));
  return room;
}

}  // namespace

const MappedRoom& Room() {
  static const MappedRoom room = LoadedRoom(60);
  return room;
}

MappedRoom WholeRoom() { return LoadedRoom(320); }

}  // namespace tutti::testing
