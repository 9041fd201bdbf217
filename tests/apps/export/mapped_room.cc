#include "tests/apps/export/mapped_room.h"

#include <utility>

#include "tests/apps/generated_dataset.h"

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

}  // namespace

const MappedRoom& Room() {
  static const GeneratedDataset data("export-room", RoomOf(60));
  static const MappedRoom room = MapOf(data.path() / "config.yaml", data.path(), 0);
  return room;
}

MappedRoom WholeRoom() {
  static const GeneratedDataset data("export-whole-room", RoomOf(320));
  return MapOf(data.path() / "config.yaml", data.path(), 0);
}

}  // namespace tutti::testing
