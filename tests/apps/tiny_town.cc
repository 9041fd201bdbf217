#include "tests/apps/tiny_town.h"

#include "tests/support/generated_dataset.h"
#include "tests/support/test_data.h"

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

TownTest::TownTest() : folder_(FreshFolder()), out_(folder_ / "out"), config_(TinyConfig(folder_)) {}

ProcessResult TownTest::Run(const std::string& out, const std::vector<std::string>& more) const {
  return RunTutti(RunArguments(config_, TinyTown(), folder_ / out, more));
}

nlohmann::json TownTest::Summary(const std::string& out) const {
  return ReadJson(folder_ / out / "summary.json");
}

}  // namespace tutti::testing
