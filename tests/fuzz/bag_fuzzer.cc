// ROS 1 bags: any bytes give frames in order, or an InputError. The first byte chooses the sensor.
#include <cmath>
#include <cstdlib>

#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"
#include "tutti/frontend/dataset.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  tutti::DatasetOptions options;
  options.type = tutti::DatasetType::kBag;
  options.sensor = static_cast<tutti::Sensor>(data[0] % 3);
  if (options.sensor != tutti::Sensor::kMono) options.topic = "/left";
  if (options.sensor == tutti::Sensor::kStereo) options.right_topic = "/right";
  if (options.sensor == tutti::Sensor::kRgbd) options.depth_topic = "/depth";
  options.camera = tutti::PinholeCamera();
  options.camera->fx = options.camera->fy = 30;
  options.baseline_m = 0.1;
  try {
    const auto dataset = tutti::OpenDataset(tutti::fuzz::MemoryFile(data + 1, size - 1), options);
    for (std::size_t i = 0; i < dataset->Size() && i < 3; ++i) {
      if (!std::isfinite(dataset->Stamp(i))) std::abort();
      const tutti::ReadResult read = dataset->Read(i);
      if (read.frame.has_value() != read.error.empty()) std::abort();
    }
  } catch (const tutti::InputError&) {
  }
  return 0;
}
