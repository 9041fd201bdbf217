// Calibrations: any bytes give a camera of finite numbers, or an InputError. The first byte chooses: what
// --calibration reads, or EuRoC's sensor.yaml.
#include <cmath>
#include <cstdlib>

#include "apps/run/calibration_file.h"
#include "frontend/dataset/layout.h"
#include "tests/fuzz/memory_file.h"
#include "tutti/core/error.h"

namespace {

void CheckCamera(const tutti::PinholeCamera& camera) {
  const bool good = std::isfinite(camera.fx) && std::isfinite(camera.fy) && std::isfinite(camera.cx) &&
                    std::isfinite(camera.cy) && camera.width >= 0 && camera.height >= 0;
  if (!good) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const auto file = tutti::fuzz::MemoryFile(data + 1, size - 1);
  try {
    if (data[0] % 2 == 0) {
      const tutti::Calibration read = tutti::ReadCalibration(file, true);
      CheckCamera(read.camera);
      if (!std::isfinite(read.baseline_m) || !std::isfinite(read.rate_hz) ||
          !std::isfinite(read.depth_units_per_m))
        std::abort();
    } else {
      CheckCamera(tutti::ReadSensorYaml(file).camera);
    }
  } catch (const tutti::InputError&) {
  }
  return 0;
}
