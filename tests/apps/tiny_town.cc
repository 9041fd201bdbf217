#include "tests/apps/tiny_town.h"

#include <string>

#include "tests/apps/tutti/executable.h"
#include "tests/support/generated_dataset.h"

namespace tutti::testing {
namespace fs = std::filesystem;

const fs::path& TinyTown() {
  static const fs::path town = GeneratedDataset([] {
    SyntheticOptions options;
    options.sensor = SyntheticSensor::kStereo;
    options.width = 480;
    options.height = 240;
    options.supersample = 1;
    options.frames = kTinyFrames;
    return options;
  }());
  return town;
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
