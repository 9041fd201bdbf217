#include "frontend/dataset/imu_file.h"

#include <array>
#include <cmath>

#include "core/numbers.h"
#include "core/text_reader.h"
#include "core/time_stamps.h"
#include "frontend/dataset/dataset_folder.h"
#include "tutti/core/error.h"
#include "tutti/core/text.h"

namespace tutti {

namespace fs = std::filesystem;

std::vector<ImuSample> ReadImuFile(const fs::path& file) {
  const std::vector<TextLine> lines = ReadListLines(file);
  StampUnit unit = StampUnit::kNanoseconds;
  std::vector<std::string> notes;
  const std::vector<double> stamps = StampsAt(file, lines, unit, notes);
  std::vector<ImuSample> samples;
  samples.reserve(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].words.size() < 7)
      throw InputError(
          At(file, lines[i].number) + "has " + std::to_string(lines[i].words.size()) +
          " columns; an IMU needs 7: time stamp, angular velocity x, y, z, acceleration x, y, z");
    ImuSample sample;
    sample.stamp_s = stamps[i];
    for (int k = 0; k < 3; ++k) {
      sample.gyro[k] = NumberAt(file, lines[i], static_cast<std::size_t>(1 + k));
      sample.acceleration[k] = NumberAt(file, lines[i], static_cast<std::size_t>(4 + k));
    }
    samples.push_back(sample);
  }
  if (samples.size() < 2) throw InputError(file.string() + ": holds no measurements of an IMU");
  return samples;
}

std::optional<ImuBeside> FindImu(const fs::path& folder) {
  std::error_code code;
  for (const char* name : {"mav0/imu0/data.csv", "imu0/data.csv", "imu.csv", "imu.txt"}) {
    if (!fs::is_regular_file(folder / name, code)) continue;
    ImuBeside found;
    found.file = folder / name;
    const fs::path yaml = found.file.parent_path() / "sensor.yaml";
    if (found.file.filename() == "data.csv" && fs::is_regular_file(yaml, code)) ReadImuYaml(yaml, &found);
    return found;
  }
  return std::nullopt;
}

}  // namespace tutti
