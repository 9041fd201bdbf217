// Bags of ROS: any bytes give frames in order, or an InputError. The first byte chooses the sensor, and the
// names of topics.
#include <cmath>
#include <cstdlib>
#include <fstream>

#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  tutti::DatasetOptions options;
  options.type = tutti::DatasetType::kBag;
  options.sensor = static_cast<tutti::Sensor>(data[0] % 3);
  const bool ros2 = data[0] / 3 % 2 == 1;
  if (ros2 || options.sensor != tutti::Sensor::kMono) options.topic = ros2 ? "/left/image" : "/left";
  if (options.sensor == tutti::Sensor::kStereo)
    options.right_topic = ros2 ? "/right/image/compressed" : "/right";
  if (options.sensor == tutti::Sensor::kRgbd) options.depth_topic = "/depth";
  options.camera = tutti::PinholeCamera();
  options.camera->fx = options.camera->fy = 30;
  options.baseline_m = 0.1;
  // Not in a file without a name, which SQLite does not find.
  static const std::filesystem::path file = tutti::fuzz::ScratchPath("bag");
  if (!std::ofstream(file, std::ios::binary)
           .write(reinterpret_cast<const char*>(data + 1), static_cast<std::streamsize>(size - 1))
           .flush())
    std::abort();
  try {
    const auto dataset = tutti::OpenDataset(file, options);
    for (std::size_t i = 0; i < dataset->Size() && i < 3; ++i) {
      if (!std::isfinite(dataset->Stamp(i))) std::abort();
      const tutti::ReadResult read = dataset->Read(i);
      if (read.frame.has_value() != read.error.empty()) std::abort();
      const tutti::ColourImage colour = dataset->ReadColour(i);
      if (colour.image.empty() == colour.error.empty()) std::abort();
      if (!colour.image.empty() && colour.image.type() != CV_8UC3) std::abort();
    }
  } catch (const tutti::InputError&) {
  }
  return 0;
}
