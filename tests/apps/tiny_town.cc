#include "tests/apps/tiny_town.h"

#include <unistd.h>

#include <string>

#include "data/synthetic/synthetic_writer.h"
#include "tests/apps/tutti/executable.h"

namespace tutti::testing {
namespace {

namespace fs = std::filesystem;

void WriteTown(const fs::path& folder) {
  SyntheticOptions options;
  options.sensor = SyntheticSensor::kStereo;
  options.width = 480;
  options.height = 240;
  options.supersample = 1;
  options.frames = kTinyFrames;
  SyntheticWriteOptions write;
  write.threads = 2;
  WriteSyntheticDataset(SyntheticWorld(options), folder, write);
}

}  // namespace

const fs::path& TinyTown() {
  // Removed when the program ends; a ctest run starts one program per test.
  struct Folder {
    fs::path path = fs::temp_directory_path() / ("tutti-tiny-town-" + std::to_string(getpid()));
    Folder() { WriteTown(path); }
    ~Folder() {
      std::error_code ignored;
      fs::remove_all(path, ignored);
    }
  };
  static const Folder folder;
  return folder.path;
}

fs::path CopyOfTinyTown(const fs::path& where) {
  fs::copy(TinyTown(), where, fs::copy_options::recursive);
  return where;
}

fs::path TinyConfig(const fs::path& folder, const std::string& more) {
  fs::path file = folder / "tiny.yaml";
  WriteAll(file, "dataset: {type: kitti, sensor: stereo}\n" + more);
  return file;
}

}  // namespace tutti::testing
