// Folders of a data set: any lists of images, calibrations and ground truths beside readable images give
// frames in order, or an InputError. The first byte chooses the layout, the second the sensor; the files
// follow, with a byte 0x1e between them.
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"

namespace {

namespace fs = std::filesystem;

struct Layout {
  tutti::DatasetType type;
  std::vector<const char*> images;  ///< that can be read
  std::vector<const char*> files;   ///< what is fuzzed
};

const std::array<Layout, 5>& Layouts() {
  static const std::array<Layout, 5> layouts = {{
      {tutti::DatasetType::kKitti,
       {"image_0/000000.png", "image_0/000001.png", "image_1/000000.png", "image_1/000001.png"},
       {"calib.txt", "times.txt", "poses.txt"}},
      {tutti::DatasetType::kTum,
       {"rgb/1.png", "rgb/2.png", "depth/1.png", "depth/2.png"},
       {"rgb.txt", "depth.txt", "groundtruth.txt"}},
      {tutti::DatasetType::kEuroc,
       {"mav0/cam0/data/1.png", "mav0/cam0/data/2.png", "mav0/cam1/data/1.png", "mav0/cam1/data/2.png"},
       {"mav0/cam0/data.csv", "mav0/cam1/data.csv", "mav0/cam0/sensor.yaml", "mav0/cam1/sensor.yaml",
        "mav0/state_groundtruth_estimate0/data.csv"}},
      {tutti::DatasetType::kPaired,
       {"image_left/0_left.png", "image_left/1_left.png", "depth_left/1_left_depth.png"},
       {"pose_left.txt", "depth_left/0_left_depth.npy"}},
      {tutti::DatasetType::kPaired,
       {"image_00/data/0.png", "image_00/data/1.png", "image_01/data/0.png", "image_01/data/1.png"},
       {"calib_cam_to_cam.txt", "image_00/timestamps.txt", "calib_imu_to_velo.txt", "calib_velo_to_cam.txt",
        "oxts/data/0.txt", "oxts/data/1.txt"}},
  }};
  return layouts;
}

const fs::path& Folder(std::size_t layout) {
  static const std::array<fs::path, 5> folders = [] {
    std::array<fs::path, 5> made;
    for (std::size_t k = 0; k < made.size(); ++k) {
      made[k] = tutti::fuzz::ScratchPath("dataset" + std::to_string(k));
      for (const char* name : Layouts()[k].images) {
        fs::create_directories((made[k] / name).parent_path());
        const bool depth = std::string_view(name).find("depth") != std::string_view::npos;
        const cv::Mat image(24, 32, depth ? CV_16UC1 : CV_8UC1, cv::Scalar(100));
        if (!cv::imwrite((made[k] / name).string(), image)) std::abort();
      }
      for (const char* name : Layouts()[k].files) fs::create_directories((made[k] / name).parent_path());
    }
    return made;
  }();
  return folders[layout];
}

// Files that the input has nothing for are not there.
void WriteFiles(const Layout& layout, const fs::path& folder, std::string_view text) {
  bool more = true;
  for (const char* name : layout.files) {
    if (!more) {
      fs::remove(folder / name);
      continue;
    }
    const std::size_t end = text.find('\x1e');
    more = end != std::string_view::npos;
    std::ofstream(folder / name, std::ios::binary) << text.substr(0, end);
    if (more) text.remove_prefix(end + 1);
  }
}

void CheckDataset(const tutti::Dataset& dataset) {
  for (std::size_t i = 0; i < dataset.Size(); ++i) {
    const bool good = std::isfinite(dataset.Stamp(i)) && (i == 0 || dataset.Stamp(i) > dataset.Stamp(i - 1));
    if (!good) std::abort();
    if (i >= 3) continue;
    const tutti::ReadResult read = dataset.Read(i);
    if (read.frame.has_value() != read.error.empty()) std::abort();
  }
  const auto truth = dataset.GroundTruthFile();
  std::vector<std::string> warnings;
  if (truth) dataset.ReadGroundTruth(*truth, &warnings);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::size_t which = data[0] % Layouts().size();
  const Layout& layout = Layouts()[which];
  WriteFiles(layout, Folder(which), {reinterpret_cast<const char*>(data) + 2, size - 2});
  tutti::DatasetOptions options;
  options.type = layout.type;
  options.sensor = static_cast<tutti::Sensor>(data[1] % 3);
  try {
    CheckDataset(*tutti::OpenDataset(Folder(which), options));
  } catch (const tutti::InputError&) {
  }
  return 0;
}
